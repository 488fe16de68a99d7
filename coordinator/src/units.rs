//! Sets of unit numbers, kept as ranges: a pass has up to millions of units, nearly all in long runs.

use std::collections::BTreeMap;
use std::ops::Range;

/// A set of unit numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnitSet {
    /// Start to end (exclusive) of disjoint ranges that don't touch.
    ranges: BTreeMap<u32, u32>,
    len: u32,
}

impl UnitSet {
    /// The units of a range.
    pub fn from_range(range: Range<u32>) -> Self {
        let mut set = Self::default();
        set.insert_range(range);
        set
    }

    /// How many units there are.
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether `unit` is one of them.
    pub fn contains(&self, unit: u32) -> bool {
        self.ranges.range(..=unit).next_back().is_some_and(|(_, end)| unit < *end)
    }

    /// The first.
    pub fn first(&self) -> Option<u32> {
        self.ranges.first_key_value().map(|(start, _)| *start)
    }

    /// The ranges, in order.
    pub fn ranges(&self) -> impl DoubleEndedIterator<Item = Range<u32>> + '_ {
        self.ranges.iter().map(|(s, e)| *s..*e)
    }

    /// The units, in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = u32> + '_ {
        self.ranges().flatten()
    }

    /// Adds one; `false` when it was there.
    pub fn insert(&mut self, unit: u32) -> bool {
        if self.contains(unit) {
            return false;
        }
        let end = self.ranges.remove(&(unit + 1)).unwrap_or(unit + 1);
        match self.ranges.range_mut(..unit).next_back() {
            Some((_, before)) if *before == unit => *before = end,
            _ => drop(self.ranges.insert(unit, end)),
        }
        self.len += 1;
        true
    }

    /// Adds a range.
    pub fn insert_range(&mut self, range: Range<u32>) {
        if range.is_empty() {
            return;
        }
        // Whole when nothing of it is there, else one by one.
        let touches = self.ranges.range(..range.end).next_back().is_some_and(|(_, end)| *end > range.start);
        if touches {
            for unit in range {
                self.insert(unit);
            }
            return;
        }
        self.len += range.end - range.start;
        let end = self.ranges.remove(&range.end).unwrap_or(range.end);
        match self.ranges.range_mut(..range.start).next_back() {
            Some((_, before)) if *before == range.start => *before = end,
            _ => drop(self.ranges.insert(range.start, end)),
        }
    }

    /// Takes one away; `false` when it was not there.
    pub fn remove(&mut self, unit: u32) -> bool {
        let Some((&start, &end)) = self.ranges.range(..=unit).next_back() else { return false };
        if unit >= end {
            return false;
        }
        self.ranges.remove(&start);
        if start < unit {
            self.ranges.insert(start, unit);
        }
        if unit + 1 < end {
            self.ranges.insert(unit + 1, end);
        }
        self.len -= 1;
        true
    }

    /// Takes away the first run, `most` units at most.
    pub fn take_first(&mut self, most: u32) -> Option<Range<u32>> {
        if most == 0 {
            return None;
        }
        let (start, end) = self.ranges.pop_first()?;
        let cut = end.min(start.saturating_add(most));
        if cut < end {
            self.ranges.insert(cut, end);
        }
        self.len -= cut - start;
        Some(start..cut)
    }
}

impl FromIterator<u32> for UnitSet {
    fn from_iter<I: IntoIterator<Item = u32>>(units: I) -> Self {
        let mut set = Self::default();
        for unit in units {
            set.insert(unit);
        }
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A plain set is the oracle of every operation.
    #[test]
    fn behaves_as_a_set() {
        let (mut set, mut oracle) = (UnitSet::default(), BTreeSet::new());
        let mut state = 1u64;
        let mut random = move |n: u32| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 33) % u64::from(n)) as u32
        };
        for _ in 0..20_000 {
            let unit = random(60);
            match random(4) {
                0 => assert_eq!(set.insert(unit), oracle.insert(unit)),
                1 => assert_eq!(set.remove(unit), oracle.remove(&unit)),
                2 => {
                    let range = unit..unit + random(6);
                    set.insert_range(range.clone());
                    oracle.extend(range);
                }
                _ => {
                    let most = random(5);
                    if let Some(taken) = set.take_first(most) {
                        assert!(!taken.is_empty() && taken.len() as u32 <= most);
                        for u in taken {
                            assert_eq!(oracle.pop_first(), Some(u));
                        }
                    } else {
                        assert!(most == 0 || oracle.is_empty());
                    }
                }
            }
            assert_eq!(set.contains(unit), oracle.contains(&unit));
            assert_eq!((set.len() as usize, set.first()), (oracle.len(), oracle.first().copied()));
            assert!(set.iter().eq(oracle.iter().copied()));
            let ranges: Vec<_> = set.ranges().collect();
            assert!(ranges.windows(2).all(|w| w[0].end < w[1].start), "ranges touch: {ranges:?}");
        }
    }
}
