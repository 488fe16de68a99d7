//! What is measured: an integrator with options of its own, written as `mmlt:mpp=64,plain`.

use renderer::integrator::IntegratorKind;
use renderer::job::RenderOptions;

/// An integrator with its budget and its tuning.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// As it was written: its name in the report.
    pub name: String,
    /// The integrator.
    pub kind: IntegratorKind,
    /// When a render of it is done.
    pub budget: Budget,
    /// What is left to the integrator, in the order in which it was written.
    pub tuning: Vec<Tuning>,
}

/// When one render is done; where nothing is set, the budget that all variants share holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget {
    /// Samples (light paths) per pixel.
    pub spp: Option<u32>,
    /// Mutations per pixel.
    pub mpp: Option<u32>,
    /// Seconds.
    pub time_s: Option<f64>,
}

/// `key=value`, or a bare `key`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tuning {
    /// What is tuned.
    pub key: String,
    /// To what; `None` for a bare key.
    pub value: Option<String>,
}

impl Budget {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl std::str::FromStr for Variant {
    type Err = String;

    /// `KIND[:ITEM,...]` where an item is `spp=N`, `mpp=N`, `time=SECONDS`, or tunes the integrator.
    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, items) = text.split_once(':').unwrap_or((text, ""));
        let mut variant =
            Self { name: text.into(), kind: kind.parse()?, budget: Budget::default(), tuning: Vec::new() };
        for item in items.split(',').filter(|i| !i.is_empty()) {
            let (key, value) = item.split_once('=').map_or((item, None), |(k, v)| (k, Some(v)));
            let count = || positive_count(key, value);
            match key {
                "" => return Err(format!("{text:?} has an option without a name")),
                "spp" => variant.budget.spp = Some(count()?),
                "mpp" => variant.budget.mpp = Some(count()?),
                "time" => variant.budget.time_s = Some(seconds(value.unwrap_or_default())?),
                _ => variant.tuning.push(Tuning { key: key.into(), value: value.map(str::to_string) }),
            }
        }
        Ok(variant)
    }
}

fn positive_count(key: &str, value: Option<&str>) -> Result<u32, String> {
    let count = value.and_then(|v| v.parse().ok()).filter(|n| *n > 0);
    count.ok_or_else(|| format!("{key} takes a whole number above 0, such as {key}=64"))
}

/// A positive number of seconds.
pub fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
    number.ok_or_else(|| format!("{text:?} is not a positive number of seconds"))
}

impl Variant {
    /// The variant as options of a render. Whatever reaches an integrator from here goes through this function.
    pub fn render_options(&self, shared: Budget) -> Result<RenderOptions, String> {
        let budget = if self.budget.is_empty() { shared } else { self.budget };
        let mut options = RenderOptions { integrator: Some(self.kind), time_s: budget.time_s, ..Default::default() };
        if self.kind == IntegratorKind::Mmlt {
            options.mpp = budget.mpp.or(budget.spp);
            let text = |t: &Tuning| t.value.as_ref().map_or(t.key.clone(), |v| format!("{}={v}", t.key));
            let tuning: Vec<String> = self.tuning.iter().map(text).collect();
            options.mmlt = Some(tuning.join(",").parse().map_err(|e| format!("{}: {e}", self.name))?);
            return Ok(options);
        }
        options.spp = budget.spp;
        for t in &self.tuning {
            let to = match (self.kind, t.key.as_str()) {
                (IntegratorKind::Path | IntegratorKind::Auto, "adaptive") => &mut options.adaptive,
                (IntegratorKind::Path, "share") => &mut options.share,
                (kind, key) => {
                    return Err(format!("{}: the integrator {} has no option {key:?}", self.name, kind.name()));
                }
            };
            let value = t.value.as_deref().unwrap_or("true").parse();
            *to = Some(value.map_err(|_| format!("{}: {} is true or false", self.name, t.key))?);
        }
        Ok(options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_budget_and_tuning() {
        let v: Variant = "path:spp=16,plain,key=a=b,time=0.5".parse().unwrap();
        assert_eq!(v.kind, IntegratorKind::Path);
        assert_eq!(v.budget, Budget { spp: Some(16), mpp: None, time_s: Some(0.5) });
        let tuning = |key: &str, value: Option<&str>| Tuning { key: key.into(), value: value.map(str::to_string) };
        assert_eq!(v.tuning, [tuning("plain", None), tuning("key", Some("a=b"))]);
        assert!(v.render_options(Budget::default()).is_err());
        assert_eq!("light".parse::<Variant>().unwrap().tuning, []);
    }

    #[test]
    fn refuses_what_makes_no_sense() {
        for text in ["", "pth", "path:spp=0", "path:spp", "path:mpp=x", "path:time=-1", "path:=3"] {
            assert!(text.parse::<Variant>().is_err(), "{text}");
        }
    }

    #[test]
    fn its_own_budget_comes_before_the_shared_one() {
        let shared = Budget { spp: Some(8), ..Default::default() };
        let spp = |text: &str| text.parse::<Variant>().unwrap().render_options(shared).unwrap().spp;
        assert_eq!(spp("path"), Some(8));
        assert_eq!(spp("path:spp=2"), Some(2));
        assert_eq!(spp("path:time=2"), None);
    }

    #[test]
    fn path_has_switches() {
        let options = |text: &str| text.parse::<Variant>().unwrap().render_options(Budget::default());
        let o = options("path:adaptive,share=false,spp=64").unwrap();
        assert_eq!((o.adaptive, o.share, o.spp), (Some(true), Some(false), Some(64)));
        assert_eq!(options("path").unwrap().adaptive, None);
        for wrong in ["path:adaptive=often", "bdpt:adaptive", "light:share"] {
            assert!(options(wrong).is_err(), "{wrong}");
        }
    }
}
