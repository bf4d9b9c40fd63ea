//! Values over time.
//!
//! In: times, in order, with a value each, and the time that is asked for. Out: the value then: of
//! points and transforms the mean of the two samples around it, as a stage interpolates, and of
//! anything else the sample before it. Before the first and behind the last time that sample counts.

use super::UsdValue;

/// Where a time lies among samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Between {
    pub(super) before: usize,
    pub(super) after: usize,
    /// How far it is from the one to the other.
    pub(super) share: f64,
}

impl Between {
    /// Where `time` lies. Without one, at the first. Nothing where there are no samples.
    pub(super) fn of(times: &[f64], time: Option<f64>) -> Option<Self> {
        let first = Self { before: 0, after: 0, share: 0.0 };
        let last = times.len().checked_sub(1)?;
        let Some(time) = time else { return Some(first) };
        let Some(before) = times.partition_point(|own| *own <= time).checked_sub(1) else {
            return Some(first);
        };
        let after = (before + 1).min(last);
        let step = times[after] - times[before];
        let share = if step > 0.0 { (time - times[before]) / step } else { 0.0 };
        Some(Self { before, after, share })
    }
}

/// Whether the values of the attribute of that name are interpolated.
pub(super) fn is_smooth(name: &str) -> bool {
    name == "points" || (name.starts_with("xformOp:") && name != "xformOpOrder")
}

/// The value at a share of the way from one to the other, or the first where their lengths differ.
pub(super) fn mixed(before: UsdValue, after: &UsdValue, share: f64) -> UsdValue {
    if before.numbers.len() != after.numbers.len() {
        return before;
    }
    let pairs = before.numbers.iter().zip(&after.numbers);
    UsdValue { numbers: pairs.map(|(a, b)| a + share * (b - a)).collect(), ..before }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_lie_between_their_samples() {
        let times = [1.0, 2.0, 4.0];
        let of = |time| {
            let Between { before, after, share } = Between::of(&times, time).unwrap();
            (before, after, share)
        };
        assert_eq!(of(None), (0, 0, 0.0));
        assert_eq!(of(Some(0.0)), (0, 0, 0.0));
        assert_eq!(of(Some(2.0)), (1, 2, 0.0));
        assert_eq!(of(Some(3.5)), (1, 2, 0.75));
        assert_eq!(of(Some(9.0)), (2, 2, 0.0));
        assert_eq!(Between::of(&[], None), None);
        // What a damaged file may have.
        assert!(Between::of(&[3.0, 1.0, f64::NAN], Some(2.0)).is_some());
    }

    #[test]
    fn only_what_has_the_same_length_is_mixed() {
        let value = |numbers: &[f64]| UsdValue { numbers: numbers.to_vec(), ..UsdValue::default() };
        assert_eq!(mixed(value(&[1.0, 2.0]), &value(&[3.0, 2.0]), 0.5), value(&[2.0, 2.0]));
        assert_eq!(mixed(value(&[1.0]), &value(&[3.0, 2.0]), 0.5), value(&[1.0]));
        assert!(is_smooth("points") && is_smooth("xformOp:translate"));
        assert!(!is_smooth("faceVertexIndices") && !is_smooth("xformOpOrder"));
    }
}
