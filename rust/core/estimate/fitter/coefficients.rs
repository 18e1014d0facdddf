//! Fits from coefficients on lines that were given: those of streams and of samples that come one by one.

use super::{FitWorkspace, Fitter};
use crate::error::Error;
use crate::estimate::band::Range;
use crate::estimate::fit::Fit;
use crate::estimate::many::Many;
use crate::estimate::options::{Options, Start, Wanted};
use crate::estimate::replicates::estimate;
use crate::estimate::rest::Initial;
use crate::estimate::window::Spectra;

impl Fitter {
    /// The same from coefficients of each record and channel, output first, on lines that were given.
    ///
    /// # Errors
    /// As [`Fitter::fit`], and [`Error::Spec`] where the lines were not given.
    pub(crate) fn fit_coefficients(&self, spectra: &Spectra) -> Result<Fit, Error> {
        let mut space = self.spaces.lend();
        let space = space.get_or(|| self.space());
        let ranges = self.take(space, spectra)?;
        self.finish(space, &ranges, Start::Wls, None)
    }

    /// The same of up to eight moments, one a lane.
    ///
    /// # Errors
    /// As [`Fitter::fit_coefficients`].
    pub(crate) fn fit_moments(&self, moments: &[Spectra]) -> Result<Many, Error> {
        let mut out = Many::default();
        let Some(first) = moments.first() else { return Ok(out) };
        let mut space = self.spaces.lend();
        let space = space.get_or(|| self.space());
        let ranges = self.take(space, first)?;
        let mut problem = self.problem(space, &ranges)?;
        let lines = problem.design.lines();
        for (lane, spectra) in moments.iter().enumerate().skip(1) {
            for (k, (channels, own)) in spectra.iter().zip(&lines).enumerate() {
                for (signal, ((re, im), unit)) in channels.iter().zip(&space.units).enumerate() {
                    let to = problem.space.signal_mut(k, signal);
                    let from = re[own.first..].iter().zip(&im[own.first..]);
                    for ((to_re, to_im), (re, im)) in to.0.iter_mut().zip(to.1).zip(from) {
                        (to_re.0[lane], to_im.0[lane]) = (re / unit, im / unit);
                    }
                    let jump = im[0] / unit;
                    problem.space.keep_jump(k, signal, own.first, |to| to.0[lane] = jump);
                }
            }
        }
        let live = std::array::from_fn(|lane| lane < moments.len());
        let options = Options { wanted: Wanted::Covariance, ..self.o.options };
        let (d, w) = (&problem.design, &mut problem.space);
        let outcome = estimate(self.isa, d, w, live, Start::Wls, &options);
        (0..moments.len()).for_each(|lane| out.push(d, w, lane, &outcome));
        space.keep(problem);
        Ok(out)
    }

    /// Coefficients onto the workspace; the lines, as given.
    fn take(&self, space: &mut FitWorkspace, spectra: &Spectra) -> Result<Vec<Range>, Error> {
        if self.o.band_is_sought() {
            return Err(Error::Spec("fitting coefficients: no band was given".into()));
        }
        if self.o.initial != Initial::Unknown {
            return Err(Error::Spec(
                "fitting coefficients: a known initial state needs the record from its start; \
                 take initial_state=\"unknown\""
                    .into(),
            ));
        }
        for ((re, im), to) in spectra.iter().flatten().zip(space.spectra.iter_mut().flatten()) {
            to.re.copy_from_slice(re);
            to.im.copy_from_slice(im);
        }
        space.begin();
        Ok(self.ranges())
    }
}
