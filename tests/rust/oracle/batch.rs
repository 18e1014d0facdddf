//! Batches of joint fits, whose lanes are records: each record's answer is that of its fit alone, whose lanes are lines.

use super::joint::{fit, options, structure, two};
use super::{fast, record::Record};
use modfun::estimate::joint::{JointBatch, JointFitter, JointOptions, JointStructure, NoiseModel};
use modfun::estimate::{Band, Time};
use modfun::quadrature::Hold;
use modfun::simd::Isa;
use modfun::structure::Method;
use modfun::threads::Control;

/// One output of this order with all the zeros there may be.
fn one(order: usize, method: Method, edge: f64) -> JointOptions {
    let s = JointStructure {
        orders: vec![order],
        numerators: vec![vec![Some(order - 1)]],
        paths: structure(true).paths[..1].to_vec(),
        ..structure(true)
    };
    JointOptions { noise: NoiseModel::output(), ..options(s, method, Band::Edges(0.0, edge)) }
}

/// Holds a batch of records to their fits alone: `within` in standard errors and of these.
fn check(o: &JointOptions, records: &[Record], within: f64, what: &str) {
    let batch = JointBatch {
        y: records.iter().flat_map(|r| &r.y).map(Vec::as_slice).collect(),
        u: records.iter().flat_map(|r| &r.u).map(Vec::as_slice).collect(),
        records: records.len(),
    };
    let sampling = [(records[0].y[0].len(), Time::Even(records[0].dt))];
    let fitter = JointFitter::new(o.clone(), &sampling, &[], Isa::detect().unwrap()).unwrap();
    let many = fitter.fit_many(&batch, 1, &mut |_, _| Control::Continue).unwrap().0;
    for (k, record) in records.iter().enumerate() {
        let alone = fit(o, std::slice::from_ref(record)).answer;
        let p = alone.theta.len();
        assert_eq!(many.status[k], alone.status, "{what}, record {k}");
        assert!(
            many.nit[k].abs_diff(alone.nit) <= 1,
            "{what}, record {k}: {} steps, {} alone",
            many.nit[k],
            alone.nit
        );
        let near = |a: f64, b: f64, of: &str| {
            assert!((a / b - 1.0).abs() < within, "{what}, record {k}: {of} {a}, alone {b}");
        };
        near(many.cost[k], alone.cost, "cost");
        for j in 0..p {
            let own = |cov: &[f64]| cov[j * (p + 1)].sqrt();
            let (at, bse) = (k * p + j, own(&alone.cov_nonrobust));
            let gap = (many.theta[at] - alone.theta[j]).abs() / bse;
            assert!(gap < within, "{what}, record {k}: parameter {j} is {gap} standard errors off");
            near(many.bse_nonrobust[at], bse, "standard error");
            near(many.bse_hc3[at], own(&alone.cov_hc3), "HC3 standard error");
            near(many.bse_spectral[at], own(&alone.cov_spectral), "spectral standard error");
            near(many.degrees[at], alone.degrees[j], "degrees");
        }
    }
}

#[test]
fn records_of_a_batch_are_fitted_as_alone() {
    for method in [Method::Awls, Method::Ml] {
        let records: Vec<Record> = (0..9).map(|k| fast::record(2, 1, 257, 0.05, k)).collect();
        let o = one(2, method, 12.0);
        check(&o, &records, 1e-5, &format!("{method:?}, one output"));
        let held = JointOptions { intersample: vec![Some(Hold::Zoh)].into(), ..o };
        check(&held, &records, 1e-5, &format!("{method:?}, held input"));
        let records: Vec<Record> = (0..9).map(|k| two(true, 0.05, 0.5, 257, k)).collect();
        let o = options(structure(true), method, Band::Edges(0.0, 12.0));
        check(&o, &records, 1e-5, &format!("{method:?}, two outputs"));
        let unknown = JointOptions { noise: NoiseModel::output(), ..o };
        check(&unknown, &records, 1e-3, &format!("{method:?}, unknown covariance"));
    }
}

#[test]
fn ill_conditioned_records_of_a_batch_are_solved_by_orthogonal_factors() {
    for method in [Method::Awls, Method::Ml] {
        let records: Vec<Record> = (0..3).map(|k| fast::record(6, 1, 513, 1e-4, k)).collect();
        check(&one(6, method, 25.0), &records, 1e-3, &format!("{method:?}"));
    }
    // Two poles and zeros too many: columns are told apart by the noise alone.
    let records: Vec<Record> = (0..3).map(|k| fast::record(2, 1, 513, 1e-5, k)).collect();
    let noise = NoiseModel { equation: true, ..NoiseModel::output() };
    let o = JointOptions { noise, ..one(4, Method::Wls, 12.0) };
    check(&o, &records, 1e-3, "poles and zeros too many");
}
