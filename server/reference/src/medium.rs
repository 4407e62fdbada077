//! Free flights and transmittances in the scene's matter, without bias: null-collision tracking
//! below piecewise constant majorants (Woodcock et al. 1965; ratio tracking: Novak et al. 2014).

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use scene::Scene;

use crate::majorant::{Majorants, Span};
use crate::matter::Field;
use crate::random::Random;
use crate::region::{Ray, Region};

/// Most tentative collisions on one ray. Only fields that are thousands of times thinner than
/// their block's densest place come near; what is given up is counted.
const MAX_TENTATIVE: u32 = 10_000_000;
/// Below this a ratio-tracked transmittance is continued with even odds, at twice its value.
const ROULETTE_BELOW: f64 = 0.1;

/// Whose way a ray is: what of clipped matter it meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The camera's: clipped matter is not there.
    View,
    /// Light's: clipped matter is there if `clip.shadows` says so, and absorbs.
    Light,
}

/// The end of a free flight.
#[derive(Debug, Clone, Copy)]
pub enum Flight {
    /// Matter at this distance, with this `s`.
    Collision(f64, f64),
    /// Nothing more on the way.
    Escape,
    /// Given up after the largest number of tentative collisions.
    Lost,
}

/// The matter of a scene.
pub struct Medium<'a> {
    /// Its field and transfer function.
    pub field: Field<'a>,
    majorants: Majorants,
    whole: Region,
    kept: Region,
    clipped_matter_blocks: bool,
    lost: AtomicU64,
}

impl<'a> Medium<'a> {
    /// Prepares the scene's matter; scans the volume on all cores.
    pub fn new(scene: &'a Scene) -> Self {
        let field = Field::new(scene);
        Self {
            majorants: Majorants::new(&field),
            field,
            whole: Region::whole(scene),
            kept: Region::kept(scene),
            clipped_matter_blocks: scene.clip.shadows,
            lost: AtomicU64::new(0),
        }
    }

    /// Rays given up so far.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// Whether the matter at a place is not clipped away.
    pub fn keeps(&self, x: DVec3) -> bool {
        self.kept.contains(x)
    }

    /// The part of a ray on which there may be matter.
    pub fn interval(&self, ray: &Ray, way: Way) -> Option<[f64; 2]> {
        let region = match way {
            Way::Light if self.clipped_matter_blocks => &self.whole,
            Way::Light | Way::View => &self.kept,
        };
        region.interval(ray)
    }

    /// The parts of an interval of a ray in the order it passes them, with bounds.
    pub fn spans(&self, ray: &Ray, interval: [f64; 2]) -> impl Iterator<Item = Span> {
        self.majorants.walk(&self.field, ray, interval)
    }

    /// Distance to the first collision, distributed as `sigma_t T`.
    pub fn flight(&self, ray: &Ray, way: Way, random: &mut Random) -> Flight {
        let Some(interval) = self.interval(ray, way) else { return Flight::Escape };
        let mut tentative = 0;
        let mut optical_depth = random.exponential();
        for span in self.spans(ray, interval) {
            let mut t = span.near;
            while optical_depth < span.majorant * (span.far - t) {
                t += optical_depth / span.majorant;
                let s = self.field.s(ray.at(t));
                if random.unit() * span.majorant < self.field.sigma_t(s) {
                    return Flight::Collision(t, s);
                }
                optical_depth = random.exponential();
                tentative += 1;
                if tentative == MAX_TENTATIVE {
                    self.lost.fetch_add(1, Ordering::Relaxed);
                    return Flight::Lost;
                }
            }
            optical_depth -= span.majorant * (span.far - t);
        }
        Flight::Escape
    }

    /// An unbiased estimate of the transmittance of light's way along a ray up to a distance.
    pub fn transmittance(&self, ray: &Ray, distance: f64, random: &mut Random) -> f64 {
        let Some([near, far]) = self.interval(ray, Way::Light) else { return 1.0 };
        let mut tentative = 0;
        let mut transmittance = 1.0;
        let mut optical_depth = random.exponential();
        for span in self.spans(ray, [near, far.min(distance)]) {
            let mut t = span.near;
            while optical_depth < span.majorant * (span.far - t) {
                t += optical_depth / span.majorant;
                let sigma_t = self.field.sigma_t(self.field.s(ray.at(t)));
                transmittance *= (1.0 - sigma_t / span.majorant).max(0.0);
                if transmittance < ROULETTE_BELOW {
                    if transmittance == 0.0 || random.unit() < 0.5 {
                        return 0.0;
                    }
                    transmittance *= 2.0;
                }
                optical_depth = random.exponential();
                tentative += 1;
                if tentative == MAX_TENTATIVE {
                    self.lost.fetch_add(1, Ordering::Relaxed);
                    return 0.0;
                }
            }
            optical_depth -= span.majorant * (span.far - t);
        }
        transmittance
    }
}
