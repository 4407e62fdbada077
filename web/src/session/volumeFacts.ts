/**
 * What the scene's volume is: description and histogram, kept in step with the scene.
 *
 * The greeting brings the description. When the scene names another volume later (another viewer
 * of the session has changed it), both are asked for.
 */

import * as rest from "../api/rest";
import type { Dataset, ShownVolume, VolumeSource } from "../generated/proto";
import { useSession } from "./store";
import { wordsOf } from "./words";

/** What of the source tells one volume from another; how much of it is shown, and how, does not. */
function keyOf({ dataset, builtin, file, dims, index }: VolumeSource): string {
  return JSON.stringify([dataset, builtin, file, dims, index]);
}

/** The dataset a source names, if it names one the service can describe. */
export const datasetOf = ({ dataset, builtin }: VolumeSource): string | null => dataset ?? builtin ?? null;

export class VolumeFacts {
  private key: string | null = null;

  /** Another session: nothing is known of its volume. */
  forget(): void {
    this.key = null;
    useSession.setState({ dataset: null, histogram: null, shown: null });
  }

  /** The greeting says what the scene's volume is. */
  greeted(volume: VolumeSource, dataset: Dataset | null, shown?: ShownVolume): void {
    const changed = keyOf(volume) !== this.key || dataset?.id !== useSession.getState().dataset?.id;
    this.key = keyOf(volume);
    useSession.setState({ dataset, shown: shown ?? null, ...(changed ? { histogram: null } : {}) });
    if (changed && dataset) void this.loadHistogram(dataset.id);
  }

  /** A scene has come: asks what its volume is if it is another one. */
  scene(volume: VolumeSource, shown?: ShownVolume): void {
    useSession.setState({ shown: shown ?? null });
    const key = keyOf(volume);
    if (key === this.key) return;
    this.key = key;
    useSession.setState({ histogram: null });
    void this.describe(key, volume);
  }

  private async describe(key: string, volume: VolumeSource): Promise<void> {
    const id = datasetOf(volume);
    try {
      const described = id === null ? null : await rest.getDataset(id);
      if (this.key !== key) return;
      useSession.setState({ dataset: described && { ...described, dims: volume.dims ?? described.dims } });
      if (described) await this.loadHistogram(described.id);
    } catch (error) {
      if (this.key === key) useSession.setState({ dataset: null, fieldError: { field: "volume", message: `The volume was changed; what it is did not arrive: ${wordsOf(error)}` } });
    }
  }

  private async loadHistogram(id: string): Promise<void> {
    const { key } = this;
    const still = () => this.key === key;
    try {
      const histogram = await rest.getHistogram(id);
      if (still()) useSession.setState({ histogram });
    } catch (error) {
      if (still()) useSession.setState({ fieldError: { field: "transfer_function", message: `The histogram did not arrive: ${wordsOf(error)}` } });
    }
  }
}
