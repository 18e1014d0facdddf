"""Parts of `mf.timelag`: roots, reducing transformation, design, simulation, structured uncertainty, fits."""
