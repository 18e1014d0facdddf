"""Control of systems with time lag by the reducing transformation (report, section 4.10).

x'(t) = Σ A_k x(t − h_k) + Σ B_r u(t − r), y = Cx. `DelaySystem` finds its characteristic roots, reduces it to
an ordinary z' = Az + Bu that holds exactly, designs u = −Kz, simulates the loop and bounds what uncertainty
may do to it. `equation` is what to fit to data, `from_fit` makes a plant of the fit.
"""

from .identify import equation, errors, from_fit
from .mu import Uncertainty
from .system import DelaySystem

__all__ = ["DelaySystem", "Uncertainty", "equation", "errors", "from_fit"]
