//! All that a unit depends on beside its number, as a document: whoever has it and the scene's files can run any unit of the pass.

use super::plan::PassPlan;
use super::settings::RenderSettings;
use crate::scene::bundle::Digest;
use serde::{Deserialize, Serialize};

/// A pass, described for those who run its units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassDocument {
    /// Digest of the scene's manifest, as JSON.
    pub manifest: Digest,
    /// The job's settings.
    pub settings: RenderSettings,
    /// The pass's plan.
    pub plan: PassPlan,
    /// Digest of the plan: its numbers must survive the way through text.
    pub plan_digest: Digest,
}

impl PassDocument {
    /// Of a plan.
    pub fn new(manifest: Digest, settings: RenderSettings, plan: PassPlan) -> Self {
        let plan_digest = plan.digest();
        Self { manifest, settings, plan, plan_digest }
    }

    /// As JSON; the same document always gives the same bytes.
    pub fn to_json(&self) -> Result<Vec<u8>, String> {
        serde_json::to_vec(self).map_err(|e| e.to_string())
    }

    /// Reads and checks what [`PassDocument::to_json`] wrote.
    pub fn from_json(bytes: &[u8]) -> Result<Self, String> {
        let document: Self = serde_json::from_slice(bytes).map_err(|e| format!("not a pass document: {e}"))?;
        for settings in std::iter::once(&document.settings).chain(document.plan.settings.as_deref()) {
            settings.validate().map_err(|e| e.to_string())?;
        }
        if document.plan.digest() != document.plan_digest {
            return Err("the numbers of the plan changed on the way through text".into());
        }
        Ok(document)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Planner, RenderOptions};
    use crate::scene::desc::RenderDefaults;

    #[test]
    fn numbers_survive_the_way_through_text() {
        let settings = RenderSettings::resolve(&RenderOptions::default(), &RenderDefaults::default()).unwrap();
        let mut plan = Planner::new(settings.clone()).first();
        let mut state = 1u32;
        plan.light_weights = (0..5000)
            .map(|_| {
                state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                f32::from_bits(state & 0x7f7f_ffff)
            })
            .collect();
        let document = PassDocument::new(Digest::of(b"manifest"), settings, plan);
        let json = document.to_json().unwrap();
        assert_eq!(PassDocument::from_json(&json).unwrap(), document);
        let text = String::from_utf8(json).unwrap();
        assert!(PassDocument::from_json(text.replace("\"pass\":0", "\"pass\":1").as_bytes()).is_err());
        assert!(PassDocument::from_json(&text.as_bytes()[..100]).is_err());
    }
}
