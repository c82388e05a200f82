//! Actions that scale the weights of a learner's sampling planner.

use super::frenet::{CostWeights, FrenetSettings, N_TERMS};
use crate::error::{Error, Result};

/// Smallest and largest factor between a changed weight and its first value, when changes add up.
const SHARES: (f64, f64) = (0.001, 2.0);
/// The largest change in one decision, as a share of the first weight, when changes add up.
const SHARE_STEP: f64 = 0.1;

/// How numbers from -1 to 1 become weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WeightChange {
    /// The first weight times ten to the power of the number.
    Absolute,
    /// The present weight plus a tenth of the first weight times the number.
    Additive,
}

/// Numbers that change weights of a planner, one per term.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightActions {
    /// The planner with its first weights.
    pub planner: FrenetSettings,
    /// Positions of the terms among the weights.
    pub terms: Vec<usize>,
    /// What a number does.
    pub change: WeightChange,
}

impl WeightActions {
    /// The terms exist, each once, and their weights can be scaled.
    ///
    /// # Errors
    /// `InvalidInput` naming the term.
    pub fn check(&self) -> Result<()> {
        self.planner.validate()?;
        let weights = self.planner.weights.as_array();
        if self.terms.is_empty() {
            return Err(Error::invalid("actions: no weight to change"));
        }
        for (i, term) in self.terms.iter().enumerate() {
            let Some(name) = CostWeights::NAMES.get(*term) else {
                return Err(Error::invalid(format!("actions: there is no weight {term}")));
            };
            if self.terms[..i].contains(term) {
                return Err(Error::invalid(format!("actions: the weight of {name} occurs twice")));
            }
            if weights[*term] == 0.0 {
                return Err(Error::invalid(format!("actions: weight of {name} is 0 and cannot be scaled")));
            }
        }
        Ok(())
    }

    /// The weights after a decision, and the mean of the absolute changes of their logarithms (base 10). Numbers are
    /// clipped.
    pub(crate) fn changed(&self, now: &CostWeights, numbers: impl Iterator<Item = f64>) -> (CostWeights, f64) {
        let (first, mut weights, mut sum) = (self.planner.weights.as_array(), now.as_array(), 0.0);
        for (term, number) in self.terms.iter().zip(numbers) {
            let (from, number) = (first[*term], number.clamp(-1.0, 1.0));
            let before = weights[*term];
            weights[*term] = match self.change {
                WeightChange::Absolute => from * 10_f64.powf(number),
                WeightChange::Additive => (before + SHARE_STEP * from * number).clamp(SHARES.0 * from, SHARES.1 * from),
            };
            sum += (weights[*term] / before).log10().abs();
        }
        (CostWeights::from_array(weights), sum / self.terms.len() as f64)
    }

    /// How often ten times the first weight, one number per term.
    pub(crate) fn powers<'a>(&'a self, now: &CostWeights) -> impl Iterator<Item = f64> + 'a {
        let (first, now) = (self.planner.weights.as_array(), now.as_array());
        self.terms.iter().map(move |term| (now[*term] / first[*term]).log10())
    }

    /// Names of the numbers that a learner observes about its planner.
    pub fn observed(&self) -> Vec<String> {
        let weight =
            |term: &usize| format!("power of ten of the weight of {}, divided by 3", CostWeights::NAMES[*term]);
        let amount = |name: &&str| format!("amount J of {name} in the last choice as J / (1 + J)");
        let status = ["1 if the last plan was chosen", "1 if the last plan brakes", "1 if there is no plan yet"];
        let weights = self.terms.iter().map(weight).chain(CostWeights::NAMES.iter().map(amount));
        weights.chain(status.map(str::to_owned)).collect()
    }

    /// Number of those numbers.
    pub fn n_observed(&self) -> usize {
        self.terms.len() + N_TERMS + 3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actions(change: WeightChange) -> WeightActions {
        // Distance to the reference (5), prediction (0.07).
        WeightActions { planner: FrenetSettings::default(), terms: vec![1, 12], change }
    }

    #[test]
    fn absolute_numbers_are_powers_of_ten_of_the_first_weights() {
        let actions = actions(WeightChange::Absolute);
        let start = actions.planner.weights;
        let (weights, change) = actions.changed(&start, [1.0, -0.5].into_iter());
        assert!((weights.distance_to_reference - 50.0).abs() < 1e-12);
        assert!((weights.prediction - 0.07 / 10_f64.sqrt()).abs() < 1e-15);
        assert!((change - 0.75).abs() < 1e-12);
        assert_eq!(weights.velocity_offset, start.velocity_offset);
        // They do not add up.
        assert_eq!(actions.changed(&weights, [0.0, 0.0].into_iter()).0, start);
    }

    #[test]
    fn additive_numbers_add_up_between_a_thousandth_and_twice_the_first_weights() {
        let actions = actions(WeightChange::Additive);
        let mut weights = actions.planner.weights;
        weights = actions.changed(&weights, [1.0, -1.0].into_iter()).0;
        assert!((weights.distance_to_reference - 5.5).abs() < 1e-12 && (weights.prediction - 0.063).abs() < 1e-12);
        for _ in 0..20 {
            weights = actions.changed(&weights, [2.0, -2.0].into_iter()).0;
        }
        assert!((weights.distance_to_reference - 10.0).abs() < 1e-12 && (weights.prediction - 0.00007).abs() < 1e-12);
        let powers: Vec<f64> = actions.powers(&weights).collect();
        assert!((powers[0] - 2_f64.log10()).abs() < 1e-12 && (powers[1] + 3.0).abs() < 1e-9);
    }

    #[test]
    fn weights_of_zero_and_terms_that_are_there_twice_are_named() {
        for (terms, text) in [
            (vec![6], "actions: weight of lateral_velocity is 0 and cannot be scaled"),
            (vec![1, 1], "actions: the weight of distance_to_reference occurs twice"),
            (vec![], "actions: no weight to change"),
            (vec![13], "actions: there is no weight 13"),
        ] {
            let error = WeightActions { terms, ..actions(WeightChange::Absolute) }.check().expect_err(text);
            assert_eq!(error.to_string(), text);
        }
    }
}
