//! Specialisations of a shader, compiled when first needed, by whichever thread needs them first.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

type Slot = Arc<OnceLock<wgpu::ComputePipeline>>;

/// Pipelines by variant.
pub struct Variants<V> {
    compiled: Mutex<HashMap<V, Slot>>,
}

impl<V: Copy + Eq + Hash> Variants<V> {
    /// The pipeline of a variant. Who asks while another thread compiles it waits for that; other
    /// variants are not held up.
    pub fn get(&self, variant: V, compile: impl FnOnce() -> wgpu::ComputePipeline) -> wgpu::ComputePipeline {
        let slot = {
            let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
            compiled.entry(variant).or_default().clone()
        };
        slot.get_or_init(compile).clone()
    }
}

impl<V> Default for Variants<V> {
    fn default() -> Self {
        Self { compiled: Mutex::default() }
    }
}
