//! Participating media.

use super::Builder;
use super::table::{Item, Table};
use crate::diagnostics::nearest;
use crate::medium::{MediumId, Phase};
use crate::scene::import::importer::Importer;
use crate::scene::import::medium::{Coefficients, Parameters};
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;

#[derive(Clone, Copy, PartialEq)]
enum PhaseKind {
    Isotropic,
    HenyeyGreenstein,
}

const PHASES: [(&str, PhaseKind); 2] = [("isotropic", PhaseKind::Isotropic), ("hg", PhaseKind::HenyeyGreenstein)];

impl<'t> Builder<'t, '_, '_> {
    /// Builds all media, in the order of their names.
    pub(super) fn media(&mut self, table: &Table<'t>) {
        for (name, _, item) in table.all() {
            let built = item.table(self.importer, &format!("the medium {name:?}")).and_then(|t| self.build_medium(t));
            self.media.insert(name, built);
        }
    }

    /// The medium that `item`, the value of `key`, names.
    pub(super) fn medium(&mut self, key: &str, item: Item<'t>) -> Option<MediumId> {
        let name = item.string(self.importer, key)?;
        if let Some(known) = self.media.get(name) {
            return *known;
        }
        let near = nearest(name, self.media.keys().copied());
        let help = near.map_or("media are tables [media.NAME]".into(), |n| format!("did you mean {n:?}?"));
        self.importer.error(item.at, format!("no medium is called {name:?}"), help);
        None
    }

    fn build_medium(&mut self, mut table: Table<'t>) -> Option<MediumId> {
        let importer = &mut *self.importer;
        let at = table.at;
        let coefficients = Coefficients::read(importer, at, &mut table, 0.0);
        // Known all the same, for the message that lists what is.
        for key in ["sigma_a", "sigma_s", "sigma_t", "albedo"] {
            table.get(key);
        }
        let scale = table.number_or(importer, "scale", Bound::NotNegative, 1.0);
        let phase = phase(importer, &mut table);
        table.finish(importer);
        importer.add_medium(at, coefficients, scale, phase)
    }
}

impl Parameters for Table<'_> {
    fn has(&self, name: &str) -> bool {
        self.has(name)
    }

    fn rgb(&mut self, importer: &mut Importer, name: &'static str, bound: Bound) -> Option<Rgb> {
        self.get(name)?.rgb(importer, name, bound)
    }
}

/// `phase`, which is `"hg"` where `g` is given.
fn phase(importer: &mut Importer, table: &mut Table) -> Phase {
    let has_g = table.has("g");
    let kind = match table.has("phase") {
        true => table.choice(importer, "phase", &PHASES),
        false if has_g => PhaseKind::HenyeyGreenstein,
        false => {
            table.get("phase");
            PhaseKind::Isotropic
        }
    };
    let g = table.number_or(importer, "g", Bound::Inside(-1.0, 1.0), 0.0);
    if kind == PhaseKind::Isotropic {
        if has_g {
            importer.error(table.at, "`g` is given, but the phase function is isotropic", "set phase = \"hg\"");
        }
        return Phase::Isotropic;
    }
    if !has_g {
        importer.error(table.at, "the phase function \"hg\" needs `g`, its mean cosine", "");
    }
    Phase::HenyeyGreenstein { g: g as f32 }
}
