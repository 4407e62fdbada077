/** Settings of `precomputed_transfer`: each is another bake, but for what becomes of a finished one. */

import { NativeSelect } from "@mantine/core";
import { Row, SliderField } from "../app/controls";
import type { Illumination } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { clusterChoicesWith, compressionInWords, bakeCostInWords, directionChoices, GRID, lightChoices, MAX_BANDS, MAX_EVENTS, MAX_PHOTONS } from "./bakes";

/** Ends of the sliders. */
const SLIDER_PHOTONS = { from: 4096, to: 4_194_304 };
const SLIDER_GRID = 64;
const SLIDER_EVENTS = 64;

export function BakeFields({ illumination }: { illumination: Illumination }) {
  const error = useSession((state) => state.compressionError);
  const edit = (patch: Partial<Illumination>, undo?: string) => session.edit({ illumination: patch }, undo);
  return (
    <>
      <Row label="Lights" hint="Lights that all light from far away is made of: more of them, sharper shadows, more memory">
        <NativeSelect aria-label="Basis lights" value={String(illumination.transfer_lights)} data={[...lightChoices]} data-testid="transfer-lights" onChange={(event) => edit({ transfer_lights: Number(event.currentTarget.value) })} />
      </Row>
      <SliderField label="Light grid" hint="Places along the volume's longest edge at which light is kept: finer shadows, more memory and photons" value={illumination.transfer_grid} min={GRID.from} max={GRID.to} sliderMax={SLIDER_GRID} step={1} testId="transfer-grid" onChange={(texels) => edit({ transfer_grid: Math.round(texels) }, "transfer-grid")} />
      <Row label="Directions" hint="Directions from which light is marched before it is scattered; few of them alias shadows">
        <NativeSelect aria-label="Directions of direct light" value={String(illumination.transfer_directions)} data={[...directionChoices]} data-testid="transfer-directions" onChange={(event) => edit({ transfer_directions: Number(event.currentTarget.value) })} />
      </Row>
      <SliderField label="Photons" hint="Photons of a bake: more of them, less noise in scattered light, more time" value={illumination.transfer_photons} min={1} max={MAX_PHOTONS} sliderMax={SLIDER_PHOTONS.to} step={1} whole toSlider={(x) => Math.log2(Math.max(SLIDER_PHOTONS.from, x))} fromSlider={(x) => Math.round(2 ** x)} testId="transfer-photons" onChange={(photons) => edit({ transfer_photons: Math.round(photons) }, "transfer-photons")} />
      <SliderField label="Events" hint="Interactions after which a photon is followed no further; dense white matter needs many" value={illumination.transfer_events} min={1} max={MAX_EVENTS} sliderMax={SLIDER_EVENTS} step={1} testId="transfer-events" onChange={(events) => edit({ transfer_events: Math.round(events) }, "transfer-events")} />
      <SliderField label="Bands" hint="Bands that tell from where light comes; smoke needs one, whatever is set here" value={illumination.transfer_bands} min={1} max={MAX_BANDS} step={1} testId="transfer-bands" onChange={(bands) => edit({ transfer_bands: Math.round(bands) }, "transfer-bands")} />
      <Row label="Compression" hint="What becomes of a finished bake: clusters take little memory and other lights come sooner; the light is a little less exact, and more so the fewer there are">
        <NativeSelect aria-label="Compression" value={String(illumination.transfer_clusters)} data={clusterChoicesWith(illumination.transfer_clusters)} data-testid="transfer-clusters" onChange={(event) => edit({ transfer_clusters: Number(event.currentTarget.value) })} />
      </Row>
      {illumination.transfer_clusters > 0 && error !== null && <p className="hint row-hint" data-testid="compression-error">{compressionInWords(error)}</p>}
      <p className="hint row-hint" data-testid="bake-cost">{bakeCostInWords(illumination.transfer_clusters)}</p>
    </>
  );
}
