/** Small pictures of what presets make of the scene: what they depend on, and those drawn so far. */

import type { SceneFile } from "../generated/proto";
import type { Patch } from "../scene/mergePatch";

/** Most pictures that are kept. */
export const MAX_PICTURES = 48;

/** What a picture of the scene with this patch depends on: equal keys, equal pictures. */
export function pictureKey(scene: SceneFile, patch: Patch): string {
  // The patch brings camera and curve; size and samples of stills do not reach small pictures.
  const sampling = { ...scene.sampling, samples_per_pixel: undefined };
  return JSON.stringify([{ ...scene, camera: undefined, transfer_function: undefined, image: undefined, sampling }, patch]);
}

/** Addresses of pictures by key, the most recently used few. */
export class PictureCache {
  private readonly addresses = new Map<string, string>();

  /** `drop` is called with the address of a picture that is kept no longer. */
  constructor(private readonly most: number, private readonly drop: (address: string) => void) {}

  get(key: string): string | null {
    const address = this.addresses.get(key);
    if (address === undefined) return null;
    // Last in the order of insertion: last to go.
    this.addresses.delete(key);
    this.addresses.set(key, address);
    return address;
  }

  keep(key: string, address: string): void {
    const before = this.addresses.get(key);
    if (before !== undefined) this.drop(before);
    this.addresses.delete(key);
    this.addresses.set(key, address);
    for (const [oldest, old] of this.addresses) {
      if (this.addresses.size <= this.most) return;
      this.addresses.delete(oldest);
      this.drop(old);
    }
  }
}
