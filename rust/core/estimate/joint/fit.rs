//! A joint fit: its lines, starts and noise levels, and everything a user sees of it.

use super::delays;
use super::design::{Colour, JointDesign, NoiseModel};
use super::fitter::{JointFitter, JointRecord, Loaded};
use super::iterate::JointStart;
use super::single::{Covariances, Ended, Single};
use super::structure::JointStructure;
use super::workspace::JointWorkspace;
use crate::error::{Error, Status};
use crate::estimate::answer::{Answer, unit_diagonal};
use crate::estimate::band::{Band, BandRule, Choice, MANY, Range, SAME};
use crate::estimate::driven::output::Levels;
use crate::estimate::record_levels::{misfits, settle};
use crate::estimate::wider::Candidate;
use crate::estimate::window::Spectra;

/// By how much of itself the criterion from the start by regression has to be lower: rounds of colour and parameters end
/// before their last digits.
const LOWER: f64 = 1e-3;

/// A finished joint fit.
#[derive(Debug, Clone)]
pub struct JointFit {
    /// Estimates (free coefficients, then free delays in seconds), covariances, outcome.
    pub answer: Answer,
    /// Variance of the noise over that given: cost in units of Σ over degrees of freedom.
    pub scale: f64,
    /// Covariance of the noise of the outputs' samples (of the equations', for equation noise).
    pub noise: Vec<f64>,
    /// Whether each parameter stands at a bound.
    pub at_bound: Vec<bool>,
    /// Noise of each record over that, of geometric mean 1 weighted by rows.
    pub record_levels: Vec<f64>,
    /// Where noise drives the system: what of it, and what of the measurement.
    pub levels: Option<Levels>,
    /// Residuals of each record and output over its noise: unit variance in Re and Im.
    pub residuals: Vec<Vec<Vec<(f64, f64)>>>,
}

impl JointFit {
    fn candidate(&self, structure: &JointStructure) -> Candidate<'_> {
        Candidate {
            answer: &self.answer,
            levels: self.noise.iter().step_by(structure.orders.len() + 1).copied().collect(),
            denominators: structure.denominators(&self.answer.theta),
        }
    }
}

impl JointFitter {
    /// Fits one structure to one record, or to several as one problem.
    ///
    /// # Errors
    /// [`Error::Data`] for what the caller can mend; failures of the numbers are a [`Status`].
    pub fn fit(&self, records: &[JointRecord<'_>]) -> Result<JointFit, Error> {
        self.fit_on(records, None)
    }

    /// The estimate to which parameters `near` it lead, on the band that was given.
    ///
    /// # Errors
    /// As [`JointFitter::fit`].
    pub fn fit_near(&self, records: &[JointRecord<'_>], near: &[f64]) -> Result<JointFit, Error> {
        if near.len() != self.o.structure.parameters() {
            let (have, want) = (near.len(), self.o.structure.parameters());
            return Err(Error::Spec(format!("fitting near {have} parameters: there are {want}")));
        }
        let mut loaded = self.load(records)?;
        let start = (&self.o.noise, JointStart::Theta(near));
        let fit = self.fit_from(&loaded, records, &self.ranges(), start)?;
        match records.len() > 1 && self.o.own_levels && self.adapts() {
            true => self.levelled(&mut loaded, records, &self.o.noise, fit),
            false => Ok(fit),
        }
    }

    /// The same as [`JointFitter::fit`], and where errors fall beyond the end of the default band, on more lines.
    /// `before`: the estimate on fewer.
    pub(crate) fn fit_on(
        &self,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let fit = self.fit_here(records, before)?;
        let Some(wider) = self.wider(fit.answer.band_rule) else { return Ok(fit) };
        let other = wider.fit_on(records, Some(&fit.answer.theta))?;
        let structure = &self.o.structure;
        let is_taken = fit.candidate(structure).yields_to(&other.candidate(structure));
        Ok(if is_taken { other } else { fit })
    }

    fn fit_here(
        &self,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let mut loaded = self.load(records)?;
        if records.len() == 1 || !(self.o.own_levels && self.adapts()) {
            return self.fit_loaded(&loaded, records, before);
        }
        if self.o.band != Band::Default {
            let first = self.fit_loaded(&loaded, records, None)?;
            return self.levelled(&mut loaded, records, &self.o.noise, first);
        }
        // Lines are chosen with the levels that few of them tell; then all tell them better than those the fit needs.
        let white = NoiseModel { colour: Colour::Given, ..self.o.noise.clone() };
        let (wide, apart) = (self.ranges(), self.estimate_apart(records));
        if let Some(theta) = self.narrow_estimate(&loaded, records, &wide, apart.as_deref())? {
            let few = (&white, JointStart::Theta(&theta));
            let few = self.fit_from(&loaded, records, &self.narrow(&wide), few)?;
            self.levelled(&mut loaded, records, &white, few)?;
        }
        let first = self.fit_loaded(&loaded, records, before)?;
        let theta = first.answer.theta.clone();
        let all = (&self.o.noise, JointStart::Theta(&theta));
        let all = self.fit_from(&loaded, records, &wide, all)?;
        self.levelled(&mut loaded, records, &self.o.noise, all)?;
        self.repeated(&loaded, records, &self.o.noise, &first)
    }

    /// The fit with noise levels of the records that its residuals have.
    fn levelled(
        &self,
        loaded: &mut Loaded,
        records: &[JointRecord<'_>],
        noise: &NoiseModel,
        first: JointFit,
    ) -> Result<JointFit, Error> {
        let misfits = |fit: &JointFit| misfits(&fit.answer, fit.scale.sqrt(), &fit.residuals);
        let (levels, fit) = settle(loaded.scales.levels.clone(), first, misfits, |levels, fit| {
            loaded.scales.levels.copy_from_slice(levels);
            self.repeated(loaded, records, noise, fit)
        })?;
        loaded.scales.levels = levels;
        Ok(fit)
    }

    /// A fit once more on its lines, from where it stands, with the levels that stand.
    fn repeated(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        noise: &NoiseModel,
        fit: &JointFit,
    ) -> Result<JointFit, Error> {
        let Answer { theta, lines, nit, band_rule, .. } = &fit.answer;
        let ranges: Vec<Range> = lines.iter().map(|l| (l.first, l.last)).collect();
        let start = JointStart::Theta(theta);
        let mut again = self.fit_from(loaded, records, &ranges, (noise, start))?;
        again.answer.nit += nit;
        again.answer.band_rule = *band_rule;
        Ok(again)
    }

    /// The estimate on these lines from one start.
    fn fit_from(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
        (noise, start): (&NoiseModel, JointStart<'_>),
    ) -> Result<JointFit, Error> {
        let d = self.design(ranges, &loaded.scales, noise, true)?;
        let mut delayed = self.delayed(records);
        let mut refresh =
            |w: &mut JointWorkspace| delays::refresh(self.isa, &d, w, &mut delayed, 1);
        let mut single = self.single(&d, loaded);
        let ended = single.estimate(start, &self.o.options, None, &mut refresh)?;
        Ok(self.finished(&d, &mut single, (ended, None), loaded))
    }

    /// The same from coefficients of each record and signal (outputs, then paths), with delays that are known.
    ///
    /// # Errors
    /// As [`JointFitter::fit`], and [`Error::Spec`] where a delay is to be found.
    pub(crate) fn fit_coefficients(&self, spectra: Spectra) -> Result<JointFit, Error> {
        if !self.o.structure.free_delays().is_empty() {
            return Err(Error::Spec(
                "fitting coefficients: a delay that is to be found needs the samples".into(),
            ));
        }
        self.fit_loaded(&Loaded::new(spectra), &[], None)
    }

    fn fit_loaded(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        before: Option<&[f64]>,
    ) -> Result<JointFit, Error> {
        let Choice { ranges, rule, theta } = self.choose(loaded, records, before)?;
        let d = self.design(&ranges, &loaded.scales, &self.o.noise, true)?;
        let mut delayed = self.delayed(records);
        let mut refresh =
            |w: &mut JointWorkspace| delays::refresh(self.isa, &d, w, &mut delayed, 1);
        let start = theta.as_deref().map_or(JointStart::Wls, JointStart::Theta);
        let mut best = self.single(&d, loaded);
        let mut ended = best.estimate(start, &self.o.options, None, &mut refresh)?;
        // On the way to the right minimum steps are few: those with Σ = 1, and those with Σ of the residuals.
        let usual = if d.estimates_covariance() { 2 * MANY } else { MANY };
        let long = ended.status == Status::MaxIter || ended.nit > usual;
        // Ways from different starts may end in different minima. Delays that were sought had many starts.
        let narrow = match (rule, &theta) {
            (None, None) if long => self.narrow_estimate(loaded, records, &ranges, None)?,
            _ => None,
        };
        let second = match (rule, &theta) {
            (Some(_), Some(_)) => Some(JointStart::Wls),
            _ => narrow.as_deref().map(JointStart::Theta),
        };
        // Steps in white noise may lead away from what regression has, and noise then takes the modes.
        let regression = match self.o.noise.colour {
            Colour::Fitted => self.regression(loaded, records, &ranges)?,
            Colour::Given => None,
        };
        let third = regression.as_deref().map(JointStart::Theta);
        for (start, by) in [(second, SAME), (third, LOWER)] {
            let Some(start) = start else { continue };
            let mut other = self.single(&d, loaded);
            // Delays stand where that ended.
            other.w.iterates.theta.now.clone_from(&best.w.iterates.theta.now);
            let found = best.estimates();
            let near = (ended.status == Status::Ok).then_some(&found[..]);
            // The second has the steps of a trial to come lower; only then is it followed to its end.
            let few = self.few_steps();
            let mut again = other.estimate(start, &few, near, &mut refresh)?;
            let lower = !again.near && other.criterion() < best.criterion();
            if again.status == Status::MaxIter && lower {
                let theta: Vec<f64> = other.w.theta(&d, 0).collect();
                let start = JointStart::Theta(&theta);
                again = other.estimate(start, &self.o.options, near, &mut refresh)?;
            }
            let cost = |single: &Single<'_>, ended: &Ended| match ended.status {
                Status::Ok => single.criterion(),
                _ => f64::INFINITY,
            };
            let least = match cost(&best, &ended) {
                found if found.is_finite() => found - by * found.abs(),
                none => none,
            };
            if !again.near && cost(&other, &again) < least {
                (best, ended) = (other, again);
            }
        }
        Ok(self.finished(&d, &mut best, (ended, rule), loaded))
    }

    /// The estimate in white noise of the equations on these lines, if there is one.
    fn regression(
        &self,
        loaded: &Loaded,
        records: &[JointRecord<'_>],
        ranges: &[Range],
    ) -> Result<Option<Vec<f64>>, Error> {
        let noise = NoiseModel { equation: true, colour: Colour::Given, ..self.o.noise.clone() };
        // What it refuses is no failure of the fit that has an answer.
        let Ok(d) = self.design(ranges, &loaded.scales, &noise, true) else { return Ok(None) };
        let mut delayed = self.delayed(records);
        let mut refresh =
            |w: &mut JointWorkspace| delays::refresh(self.isa, &d, w, &mut delayed, 1);
        let mut single = self.single(&d, loaded);
        let options = self.few_steps();
        let ended = single.estimate(JointStart::Wls, &options, None, &mut refresh)?;
        let is_there = matches!(ended.status, Status::Ok | Status::MaxIter);
        Ok(is_there.then(|| single.w.theta(&d, 0).collect()))
    }

    /// What a user sees of an estimate.
    fn finished(
        &self,
        d: &JointDesign,
        single: &mut Single<'_>,
        (ended, band_rule): (Ended, Option<BandRule>),
        loaded: &Loaded,
    ) -> JointFit {
        let q = d.outputs();
        let freedom = d.degrees_of_freedom();
        let (found, status) = single.answer(ended);
        let Covariances {
            nonrobust,
            hc3,
            spectral,
            degrees,
            noise_spectrum,
            normal,
            residuals,
            ..
        } = found;
        let w = &single.w;
        let cost = w.progress.cost.0[0];
        let scale = cost / freedom as f64;
        let plain_sigma = scale.sqrt();
        let unit = |i: usize| d.residual_unit(i);
        let noise =
            (0..q * q).map(|k| w.sigma[k].0[0] * scale * unit(k / q) * unit(k % q)).collect();
        let p = d.parameters();
        let over = |(re, im): &(f64, f64)| (re / plain_sigma, im / plain_sigma);
        let fit = JointFit {
            answer: Answer {
                theta: w.theta(d, 0).collect(),
                cov_nonrobust: nonrobust,
                cov_hc3: hc3,
                cov_spectral: spectral,
                degrees,
                noise_spectrum,
                gram: unit_diagonal(|k| normal[k], p),
                cost: if q == 1 { cost * w.sigma[0].0[0] * unit(0) * unit(0) } else { cost },
                degrees_of_freedom: freedom,
                status,
                nit: ended.nit,
                lines: d.lines(),
                band_rule,
            },
            scale,
            noise,
            levels: None,
            record_levels: loaded.scales.levels.iter().map(|v| v.sqrt()).collect(),
            at_bound: w.pinned.iter().map(|v| v.0[0] > 0.0).collect(),
            residuals: residuals
                .iter()
                .map(|r| r.iter().map(|o| o.iter().map(over).collect()).collect())
                .collect(),
        };
        if self.o.driven { self.driven(d, single, fit, ended) } else { fit }
    }
}
