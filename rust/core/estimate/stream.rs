//! Estimates from the last samples of a stream: sliding coefficients into a fitter, at any moment.

use super::fit::{Fit, FitOptions, Time};
use super::fitter::Fitter;
use super::joint::{JointFit, JointFitter, JointOptions, Scales};
use super::many::Many;
use super::window::Spectra;
use crate::error::{Error, Status};
use crate::simd::{Isa, LANES};
use crate::spectrum::{CoefficientPlan, Sliding};

/// What estimates from the coefficients of one or several records, the latest first.
pub trait Slider: Sized {
    /// What makes one.
    type Options: Clone;
    /// The fit it makes.
    type Fit;
    /// For `records` records of `samples` samples each, `dt` apart.
    ///
    /// # Errors
    /// As the fitter's own.
    fn make(
        options: Self::Options,
        samples: usize,
        dt: f64,
        records: usize,
        isa: Isa,
    ) -> Result<Self, Error>;
    /// The plans of a record, and which channel (outputs, then inputs) each takes.
    fn plans(&self) -> Vec<(usize, &CoefficientPlan)>;
    /// Whether the lines allow an estimate of one record.
    ///
    /// # Errors
    /// As the fitter's own.
    fn check(&self) -> Result<(), Error>;
    /// Parameters.
    fn parameters(&self) -> usize;
    /// Fits coefficients of all records.
    ///
    /// # Errors
    /// As the fitter's own.
    fn answer(&self, spectra: &Spectra) -> Result<Self::Fit, Error>;
    /// Fits those of up to eight moments, each by itself.
    ///
    /// # Errors
    /// As the fitter's own.
    fn answers(&self, moments: &[Spectra]) -> Result<Many, Error>;
}

/// A fitter that sees the last window of every channel, and windows before it with less weight.
pub struct Stream<F: Slider> {
    options: F::Options,
    isa: Isa,
    dt: f64,
    samples: usize,
    /// Of each window back in time: what its samples are multiplied by.
    weights: Vec<f64>,
    /// For one window, two, …; those after the first are made when needed.
    fitters: Vec<F>,
    /// One a plan: its channel, and its coefficients, window after window back in time.
    slides: Vec<(usize, Vec<Sliding>)>,
    /// Of each channel: its last sample, and for how many samples it has stood there.
    last: Vec<(f64, u64)>,
}

impl<F: Slider> Stream<F> {
    /// A stream over windows of `samples` samples, `dt` seconds apart. `weights` multiply the samples of the
    /// last window, the one before it, …: one for each window that is remembered.
    ///
    /// # Errors
    /// Those of the fitter and of [`Sliding::new`]; [`Error::Spec`] without weights.
    pub fn new(
        options: F::Options,
        samples: usize,
        dt: f64,
        weights: &[f64],
        isa: Isa,
    ) -> Result<Stream<F>, Error> {
        if weights.is_empty() {
            return Err(Error::Spec("streaming: no window is to be remembered".into()));
        }
        let fitter = F::make(options.clone(), samples, dt, 1, isa)?;
        fitter.check()?;
        let slide = |(channel, plan): (usize, &CoefficientPlan)| {
            let one = Sliding::new(plan)?;
            Ok((channel, vec![one; weights.len()]))
        };
        let slides: Vec<_> = fitter.plans().into_iter().map(slide).collect::<Result<_, Error>>()?;
        let channels = slides.iter().map(|(channel, _)| channel + 1).max().unwrap_or(0);
        Ok(Stream {
            options,
            isa,
            dt,
            samples,
            weights: weights.to_vec(),
            fitters: vec![fitter],
            slides,
            last: vec![(0.0, 0); channels],
        })
    }

    /// Takes one sample of every channel, outputs first; a channel that is missing reads as NaN.
    pub fn push(&mut self, channels: &[f64]) {
        for ((last, stood), sample) in self.last.iter_mut().zip(channels) {
            (*last, *stood) = (*sample, if sample == last { *stood + 1 } else { 1 });
        }
        for (channel, windows) in &mut self.slides {
            let mut sample = channels.get(*channel).copied().unwrap_or(f64::NAN);
            for window in windows {
                // What comes to the window before is the sample that stands at this one's beginning.
                let before = window.samples() - 1 - window.intervals();
                window.push(sample);
                if window.count() <= window.intervals() as u64 {
                    break;
                }
                sample = window.at(before);
            }
        }
    }

    /// Windows whose samples are all there.
    #[must_use]
    pub fn windows(&self) -> usize {
        let full = |(_, all): &(usize, Vec<Sliding>)| all.iter().filter(|w| w.ready()).count();
        self.slides.iter().map(full).min().unwrap_or(0)
    }

    /// Samples so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.slides.first().map_or(0, |(_, windows)| windows[0].count())
    }

    /// Whether a channel that counts has one value in all windows that are there: then nothing can be learnt
    /// from it, and what sums hold of it is rounding.
    #[must_use]
    pub fn stands(&self) -> bool {
        let seen =
            |intervals: usize| (self.samples + (self.windows().max(1) - 1) * intervals) as u64;
        self.slides.iter().any(|(channel, all)| self.last[*channel].1 >= seen(all[0].intervals()))
    }

    /// The estimate from the windows that are there.
    ///
    /// # Errors
    /// [`Error::Data`] before the first window is full; those of the fitter.
    pub fn fit(&mut self) -> Result<F::Fit, Error> {
        let spectra = self.spectra()?;
        self.fitters[spectra.len() - 1].answer(&spectra)
    }

    /// What [`Stream::follow`] notes, of this moment.
    ///
    /// # Errors
    /// As [`Stream::fit`].
    pub fn now(&mut self) -> Result<Many, Error> {
        let spectra = self.spectra()?;
        let mut found = Many::default();
        match self.stands() {
            true => self.nothing(&mut found),
            false => found = self.fitters[spectra.len() - 1].answers(&[spectra])?,
        }
        Ok(found)
    }

    /// Takes samples of all channels one after the other, with an estimate after every `every`-th of the
    /// stream: how many samples there were, and what came out.
    ///
    /// # Errors
    /// Those of the fitter.
    pub fn follow(&mut self, samples: &[Vec<f64>], every: u64) -> Result<(Vec<u64>, Many), Error> {
        let (mut counts, mut found) = (Vec::new(), Many::default());
        let mut waiting: Vec<Spectra> = Vec::new();
        for sample in samples {
            self.push(sample);
            if !self.count().is_multiple_of(every.max(1)) || self.windows() == 0 {
                continue;
            }
            counts.push(self.count());
            let stands = self.stands();
            let full = waiting.len() == LANES;
            if full || stands || waiting.first().is_some_and(|w| w.len() != self.windows()) {
                self.settle(&mut waiting, &mut found)?;
            }
            match stands {
                true => self.nothing(&mut found),
                false => waiting.push(self.spectra()?),
            }
        }
        self.settle(&mut waiting, &mut found)?;
        Ok((counts, found))
    }

    /// Estimates of the moments that wait.
    fn settle(&self, waiting: &mut Vec<Spectra>, found: &mut Many) -> Result<(), Error> {
        if let Some(first) = waiting.first() {
            found.append(self.fitters[first.len() - 1].answers(waiting)?);
            waiting.clear();
        }
        Ok(())
    }

    /// The row of a moment at which a channel stands.
    fn nothing(&self, found: &mut Many) {
        let none = vec![f64::NAN; self.fitters[0].parameters()];
        found.append(Many {
            theta: none.clone(),
            bse_nonrobust: none.clone(),
            bse_hc3: none.clone(),
            bse_spectral: none.clone(),
            degrees: none,
            status: vec![Status::Rank],
            cost: vec![f64::NAN],
            nit: vec![0],
            hc3_degrees: Vec::new(),
            levels: Vec::new(),
        });
    }

    /// Coefficients of the windows that are there, for which there is a fitter then.
    fn spectra(&mut self) -> Result<Spectra, Error> {
        let windows = self.windows();
        if windows == 0 {
            return Err(Error::Data(format!(
                "streaming: {} of the {} samples of the window are there; push more before asking",
                self.count(),
                self.samples
            )));
        }
        while self.fitters.len() < windows {
            let more = self.fitters.len() + 1;
            let fitter = F::make(self.options.clone(), self.samples, self.dt, more, self.isa)?;
            self.fitters.push(fitter);
        }
        let mut spectra: Spectra = vec![Vec::with_capacity(self.slides.len()); windows];
        for ((_, plan), (_, slides)) in self.fitters[0].plans().iter().zip(&self.slides) {
            let lines = plan.harmonics() + 1;
            for ((window, weight), to) in slides.iter().zip(&self.weights).zip(&mut spectra) {
                let (mut re, mut im) = (vec![0.0; lines], vec![0.0; lines]);
                window.coefficients(&mut re, &mut im);
                re.iter_mut().chain(&mut im).for_each(|v| *v *= weight);
                to.push((re, im));
            }
        }
        Ok(spectra)
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.slides.iter_mut().flat_map(|(_, windows)| windows).for_each(Sliding::clear);
        self.last.fill((0.0, 0));
    }
}

impl Slider for Fitter {
    type Options = FitOptions;
    type Fit = Fit;

    fn make(
        options: FitOptions,
        samples: usize,
        dt: f64,
        records: usize,
        isa: Isa,
    ) -> Result<Fitter, Error> {
        Fitter::new(options, &vec![(samples, Time::Even(dt)); records], isa)
    }

    fn plans(&self) -> Vec<(usize, &CoefficientPlan)> {
        self.records[0].plans.iter().enumerate().collect()
    }

    fn check(&self) -> Result<(), Error> {
        self.design(&[self.records[0].range], &[1.0]).map(drop)
    }

    fn parameters(&self) -> usize {
        self.o.structure.parameters()
    }

    fn answer(&self, spectra: &Spectra) -> Result<Fit, Error> {
        self.fit_coefficients(spectra)
    }

    fn answers(&self, moments: &[Spectra]) -> Result<Many, Error> {
        self.fit_moments(moments)
    }
}

impl Slider for JointFitter {
    type Options = JointOptions;
    type Fit = JointFit;

    fn make(
        options: JointOptions,
        samples: usize,
        dt: f64,
        records: usize,
        isa: Isa,
    ) -> Result<JointFitter, Error> {
        JointFitter::new(options, &vec![(samples, Time::Even(dt)); records], &[], isa)
    }

    fn plans(&self) -> Vec<(usize, &CoefficientPlan)> {
        let outputs = self.o.structure.orders.len();
        let inputs = self.o.structure.paths.iter().map(|path| outputs + path.input);
        (0..outputs).chain(inputs).zip(&self.records[0].plans).collect()
    }

    fn check(&self) -> Result<(), Error> {
        let scales = Scales { units: vec![1.0; self.records[0].plans.len()], levels: vec![1.0] };
        self.design(&[self.records[0].range], &scales, &self.o.noise, true).map(drop)
    }

    fn parameters(&self) -> usize {
        self.o.structure.parameters()
    }

    fn answer(&self, spectra: &Spectra) -> Result<JointFit, Error> {
        self.fit_coefficients(spectra.clone())
    }

    fn answers(&self, moments: &[Spectra]) -> Result<Many, Error> {
        let mut many = Many::default();
        for spectra in moments {
            many.push_answer(&self.fit_coefficients(spectra.clone())?.answer);
        }
        Ok(many)
    }
}
