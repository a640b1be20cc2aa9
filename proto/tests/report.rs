//! The names of what reports take from the core.

use cager_core::coordinates::Refinement;
use cager_core::spectral::maxvol::Volume;

#[test]
fn volumes_and_refinements_keep_their_names() {
    let volume = Volume { swaps: 3, log_volume: -1.5, max_entry: 1.25 };
    let refinement = Refinement { elements: 40, refinements: 2, change: 0.5 };
    assert_eq!(serde_json::to_string(&volume).unwrap(), r#"{"swaps":3,"log_volume":-1.5,"max_entry":1.25}"#);
    assert_eq!(serde_json::to_string(&refinement).unwrap(), r#"{"elements":40,"refinements":2,"change":0.5}"#);
}
