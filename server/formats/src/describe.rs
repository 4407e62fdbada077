//! What was found in a file, as JSON.

use rayon::prelude::*;
use scene::{Volume, Voxels};
use serde_json::{Value, json};

use crate::Imported;
use crate::voxels::type_name;

/// Voxels that one thread looks at in one go.
const PARALLEL_CHUNK: usize = 1 << 18;

/// Smallest and largest data value of a volume, slope and intercept applied.
pub fn data_range(volume: &Volume) -> [f64; 2] {
    let [low, high] = stored_range(&volume.voxels);
    let a = volume.slope * low + volume.intercept;
    let b = volume.slope * high + volume.intercept;
    [a.min(b), a.max(b)]
}

/// Smallest and largest stored value.
pub(crate) fn stored_range(voxels: &Voxels) -> [f64; 2] {
    fn range<T: Copy + PartialOrd + Sync + Send + Into<f64>>(values: &[T]) -> [f64; 2] {
        let Some(first) = values.first().copied() else {
            return [0.0, 0.0];
        };
        let wider =
            |a: (T, T), b: (T, T)| (if b.0 < a.0 { b.0 } else { a.0 }, if b.1 > a.1 { b.1 } else { a.1 });
        let (low, high) = values
            .par_chunks(PARALLEL_CHUNK)
            .map(|chunk| chunk.iter().fold((first, first), |a, v| wider(a, (*v, *v))))
            .reduce(|| (first, first), wider);
        [low.into(), high.into()]
    }
    match voxels {
        Voxels::U8(values) => range(values),
        Voxels::U16(values) => range(values),
        Voxels::I16(values) => range(values),
        Voxels::F32(values) => range(values),
    }
}

/// Describes an imported file: `format`, `dims`, `spacing`, `spacing_unit`, `type` (the file's),
/// `stored_type` (in memory), `range` (data values), `labels` (of a label volume, else `null`),
/// `orientation` (`null` if none), `choices`, `choice_names`, `notices`. Dims, spacing and orientation are those after reordering.
pub fn describe(imported: &Imported) -> Value {
    let volume = &imported.volume;
    let orientation = volume.orientation.map(|orientation| {
        json!({
            "axes": "LPS",
            "directions": orientation.lps_from_grid,
            "origin": orientation.origin,
        })
    });
    json!({
        "format": imported.format.name(),
        "dims": volume.dims,
        "spacing": volume.spacing,
        "spacing_unit": volume.spacing_unit,
        "type": type_name(imported.file_type),
        "stored_type": type_name(volume.voxels.voxel_type()),
        "range": data_range(volume),
        "labels": scene::labels::labels(volume).map(|labels| {
            labels.iter().map(|label| label.value).collect::<Vec<f64>>()
        }),
        "slope": volume.slope,
        "intercept": volume.intercept,
        "orientation": orientation,
        "choices": imported.choices,
        "choice_names": imported.choice_names,
        "notices": imported.notices,
    })
}
