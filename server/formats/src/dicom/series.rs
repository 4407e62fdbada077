//! From slices to volumes: which slices belong together, in which order, how far apart.

use crate::error::FormatError;
use crate::orientation::{Vec3, dot};

/// Cosine above which two slices count as parallel (0.25 degrees).
const MIN_PARALLEL_COS: f64 = 0.999_99;
/// Share of the step between slices by which positions may differ from even ones; tags are
/// rounded to micrometres or worse.
const EVEN_TOLERANCE: f64 = 0.02;
/// The same, as a share above which a step is reckoned to leave slices out.
const GAP_TOLERANCE: f64 = 0.1;
/// Positions nearer than this are one, millimetres.
const SAME_POSITION_MM: f64 = 1e-3;
/// Sideways drift per step, as a share of it, that is worth a notice.
const DRIFT_TOLERANCE: f64 = 0.02;
/// Slices put in for missing ones, per slice that is there.
const MAX_FILLED_SHARE: f64 = 1.0;

/// A slice: a frame of a file with what sorting needs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Slice {
    pub(super) file: usize,
    pub(super) frame: usize,
    pub(super) instance: i64,
    pub(super) position: Option<Vec3>,
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

/// What slices of one volume have in common.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Key {
    pub(super) series_uid: String,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) orientation: Option<[Vec3; 2]>,
    pub(super) spacing: Option<[f64; 2]>,
    pub(super) stack: (String, u64),
}

/// Slices of one volume.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub(super) key: Key,
    pub(super) modality: String,
    pub(super) description: String,
    pub(super) series_number: i64,
    pub(super) stated_step: Option<f64>,
    pub(super) slices: Vec<Slice>,
}

/// What a slice of the volume is made of: stored slices by their index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Layer {
    Stored(usize),
    /// Between two, at a share of the way.
    Between(usize, usize, f64),
}

/// A volume's slices in order along the normal, and their distance.
#[derive(Debug)]
pub(super) struct Stack {
    pub(super) layers: Vec<Layer>,
    pub(super) step: f64,
    /// Centre of the first pixel of the first slice.
    pub(super) origin: Option<Vec3>,
}

impl Key {
    /// Whether slices of both can lie in one volume; differences of rounding do not count.
    pub(super) fn fits(&self, other: &Key) -> bool {
        let parallel = match (&self.orientation, &other.orientation) {
            (Some(a), Some(b)) => (0..2).all(|axis| dot(a[axis], b[axis]) >= MIN_PARALLEL_COS),
            (a, b) => a.is_none() && b.is_none(),
        };
        let near = |a: f64, b: f64| (a - b).abs() <= EVEN_TOLERANCE * 0.01 * a.abs().max(b.abs());
        let spaced = match (self.spacing, other.spacing) {
            (Some(a), Some(b)) => near(a[0], b[0]) && near(a[1], b[1]),
            (a, b) => a.is_none() && b.is_none(),
        };
        parallel
            && spaced
            && (self.rows, self.columns) == (other.rows, other.columns)
            && self.stack == other.stack
            && self.series_uid == other.series_uid
    }

    fn normal(&self) -> Option<Vec3> {
        self.orientation.map(|[a, b]| crate::orientation::cross(a, b))
    }
}

impl Group {
    /// One line for people: modality, description, size.
    pub(super) fn name(&self) -> String {
        let Key { rows, columns, .. } = self.key;
        let slices = self.slices.len();
        let plural = if slices == 1 { "" } else { "s" };
        let words = [self.modality.as_str(), self.description.as_str()];
        let words: Vec<&str> = words.into_iter().filter(|word| !word.is_empty()).collect();
        let title = if words.is_empty() { "image".to_owned() } else { words.join(" ") };
        let title: String = title.chars().filter(|c| !c.is_control()).collect();
        format!("{title} ({columns} x {rows}, {slices} slice{plural})")
    }

    /// Splits off moments: where each position is there equally often, the series has that many
    /// volumes, one after the other by instance number.
    pub(super) fn split_moments(mut self) -> Vec<Group> {
        let Some(normal) = self.key.normal() else { return vec![self] };
        let Some(along) = along(&self.slices, normal) else { return vec![self] };
        let mut order: Vec<usize> = (0..along.len()).collect();
        order.sort_by(|&a, &b| along[a].total_cmp(&along[b]));
        let same = |a: &usize, b: &usize| (along[*a] - along[*b]).abs() < SAME_POSITION_MM;
        let places: Vec<Vec<usize>> = order.chunk_by(same).map(<[usize]>::to_vec).collect();
        let moments = places.first().map_or(1, Vec::len);
        if moments < 2 || places.len() < 2 || places.iter().any(|place| place.len() != moments) {
            return vec![self];
        }
        let slices = std::mem::take(&mut self.slices);
        let mut groups = vec![self; moments];
        for mut place in places {
            place.sort_by_key(|&i| (slices[i].instance, slices[i].file, slices[i].frame));
            for (moment, index) in place.into_iter().enumerate() {
                groups[moment].slices.push(slices[index].clone());
            }
        }
        for (moment, group) in groups.iter_mut().enumerate() {
            group.key.stack.1 = moment as u64;
        }
        groups
    }

    /// Puts the slices in order.
    ///
    /// # Errors
    /// More slices are missing than are there.
    pub(super) fn stack(&self, file: &str, notices: &mut Vec<String>) -> Result<Stack, FormatError> {
        let by_instance = |&i: &usize| {
            let slice = &self.slices[i];
            (slice.instance, slice.file, slice.frame)
        };
        let mut order: Vec<usize> = (0..self.slices.len()).collect();
        order.sort_by_key(by_instance);
        let along = self.key.normal().and_then(|normal| along(&self.slices, normal));
        let (Some(along), Some(normal)) = (along, self.key.normal()) else {
            if order.len() > 1 || self.key.orientation.is_some() {
                notices.push("slices without positions are stacked by their numbers".to_owned());
            }
            let step = self.stated_step(notices);
            let layers = order.into_iter().map(Layer::Stored).collect();
            return Ok(Stack { layers, step, origin: None });
        };
        // The sort is stable: of equal positions, the lowest instance number stays.
        order.sort_by(|&a, &b| along[a].total_cmp(&along[b]));
        let all = order.len();
        order.dedup_by(|later, kept| (along[*later] - along[*kept]).abs() < SAME_POSITION_MM);
        if order.len() < all {
            notices.push(format!(
                "{} of {all} slices lie where another one does: the one of the lowest number is shown",
                all - order.len()
            ));
        }
        let origin = order.first().and_then(|&first| self.slices[first].position);
        if order.len() == 1 {
            let step = self.stated_step(notices);
            return Ok(Stack { layers: vec![Layer::Stored(order[0])], step, origin });
        }
        let steps: Vec<f64> = order.windows(2).map(|pair| along[pair[1]] - along[pair[0]]).collect();
        let typical = median(&steps);
        let (layers, step) = self.layers(file, &order, &steps, typical, &along, notices)?;
        self.notice_step(step, notices);
        self.notice_drift(&order, normal, step, notices);
        Ok(Stack { layers, step, origin })
    }

    /// Fills what is missing; slices at uneven positions keep their order.
    fn layers(
        &self,
        file: &str,
        order: &[usize],
        steps: &[f64],
        typical: f64,
        along: &[f64],
        notices: &mut Vec<String>,
    ) -> Result<(Vec<Layer>, f64), FormatError> {
        let uneven = |step: f64| (step / typical - 1.0).abs() > EVEN_TOLERANCE;
        if !steps.iter().any(|step| uneven(*step)) {
            // Rounded positions: the mean is more exact than any one of them.
            let total: f64 = steps.iter().sum();
            return Ok((order.iter().copied().map(Layer::Stored).collect(), total / steps.len() as f64));
        }
        let multiple = |step: f64| (step / typical).round().max(1.0);
        let is_gap = |step: f64| (step / typical - multiple(step)).abs() <= GAP_TOLERANCE;
        let missing: f64 = steps.iter().map(|step| multiple(*step) - 1.0).sum();
        if missing > MAX_FILLED_SHARE * order.len() as f64 {
            return Err(FormatError::field(
                file,
                "ImagePositionPatient",
                format!("{missing} slices missing between {} at steps of {typical} mm", order.len()),
                "a series without such gaps",
            ));
        }
        if !steps.iter().all(|step| is_gap(*step)) {
            let range = steps.iter().fold([f64::INFINITY, 0.0], |[a, b], s| [s.min(a), s.max(b)]);
            let mean = steps.iter().sum::<f64>() / steps.len() as f64;
            notices.push(format!(
                "the slices are {:.3} to {:.3} mm apart and are shown as if all were {mean:.3} mm apart",
                range[0], range[1]
            ));
            return Ok((order.iter().copied().map(Layer::Stored).collect(), mean));
        }
        let mut layers = vec![Layer::Stored(order[0])];
        for (pair, step) in order.windows(2).zip(steps) {
            let count = multiple(*step);
            if count > 1.0 {
                notices.push(format!(
                    "{} missing between slices at {:.3} and {:.3} mm along the normal, interpolated",
                    count - 1.0,
                    along[pair[0]],
                    along[pair[1]]
                ));
            }
            let between = (1..count as u64).map(|k| Layer::Between(pair[0], pair[1], k as f64 / count));
            layers.extend(between);
            layers.push(Layer::Stored(pair[1]));
        }
        Ok((layers, typical))
    }

    fn stated_step(&self, notices: &mut Vec<String>) -> f64 {
        self.stated_step.unwrap_or_else(|| {
            notices.push("the file does not say how thick the slices are: 1 mm is taken".to_owned());
            1.0
        })
    }

    /// Tags that contradict the positions.
    fn notice_step(&self, step: f64, notices: &mut Vec<String>) {
        if let Some(stated) = self.stated_step
            && (stated / step - 1.0).abs() > GAP_TOLERANCE
        {
            notices.push(format!(
                "by their positions the slices are {step:.3} mm apart, by their tags {stated:.3} mm: the \
                 positions are taken"
            ));
        }
    }

    /// Slices that move sideways, as with a tilted gantry.
    fn notice_drift(&self, order: &[usize], normal: Vec3, step: f64, notices: &mut Vec<String>) {
        let ends = [order.first(), order.last()].map(|i| i.and_then(|&i| self.slices[i].position));
        let [Some(first), Some(last)] = ends else { return };
        let way = [0, 1, 2].map(|k| last[k] - first[k]);
        let forward = dot(way, normal);
        let sideways = crate::orientation::norm([0, 1, 2].map(|k| way[k] - forward * normal[k]));
        let drift = sideways / (order.len() - 1) as f64;
        if drift > DRIFT_TOLERANCE * step {
            let degrees = (sideways / forward).atan().to_degrees();
            notices.push(format!(
                "each slice lies {drift:.3} mm beside the one before (a gantry tilt of {degrees:.1} \
                 degrees); they are drawn straight above each other"
            ));
        }
    }
}

/// Positions along the normal; `None` unless every slice has one.
fn along(slices: &[Slice], normal: Vec3) -> Option<Vec<f64>> {
    slices.iter().map(|slice| slice.position.map(|position| dot(position, normal))).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}
