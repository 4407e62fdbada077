//! Environment images as light in pixels of equal area, kept while they are in use.

use scene::spherical::sky::Sky;

/// Images whose fine maps are kept.
const MAX_SKIES: usize = 4;

/// Fine maps of environment images, by content, least recently used first.
#[derive(Default)]
pub(crate) struct Skies(Vec<([u8; 32], Sky)>);

impl Skies {
    /// That of an image.
    pub fn of(&mut self, image: &scene::EnvironmentImage) -> &Sky {
        let content = image.content();
        match self.0.iter().position(|(held, _)| *held == content) {
            Some(at) => {
                let entry = self.0.remove(at);
                self.0.push(entry);
            }
            None => {
                if self.0.len() >= MAX_SKIES {
                    self.0.remove(0);
                }
                self.0.push((content, Sky::of(image)));
            }
        }
        &self.0[self.0.len() - 1].1
    }

    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.0.len()
    }
}
