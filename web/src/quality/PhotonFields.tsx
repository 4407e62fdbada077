/** Settings of `photon_map`: how many photons, how far they are followed, how finely their light is kept. */

import { NativeSelect } from "@mantine/core";
import { Row, SliderField } from "../app/controls";
import type { Illumination } from "../generated/proto";
import { session } from "../session/engine";
import { gatherChoices } from "./photons";
import { ShadowGridField } from "./ShadowGridField";

const MAX_PHOTONS = 1 << 24;
/** Photons at the ends of the slider. */
const SLIDER_PHOTONS = { from: 1024, to: 4_194_304 };
const MAX_EVENTS = 256;
/** Interactions at the end of the slider. */
const SLIDER_EVENTS = 64;
const GRID = { from: 4, to: 256 };

export function PhotonFields({ illumination }: { illumination: Illumination }) {
  return (
    <>
      <SliderField label="Photons" hint="Photons of each light: more of them, less noise, more time and memory" value={illumination.photons} min={1} max={MAX_PHOTONS} sliderMax={SLIDER_PHOTONS.to} step={1} whole toSlider={(x) => Math.log2(Math.max(SLIDER_PHOTONS.from, x))} fromSlider={(x) => Math.round(2 ** x)} testId="photons" onChange={(photons) => session.edit({ illumination: { photons: Math.round(photons) } }, "photons")} />
      <SliderField label="Events" hint="Interactions after which a photon is followed no further; dense white matter needs many" value={illumination.photon_events} min={1} max={MAX_EVENTS} sliderMax={SLIDER_EVENTS} step={1} testId="photon-events" onChange={(events) => session.edit({ illumination: { photon_events: Math.round(events) } }, "photon-events")} />
      <SliderField label="Light grid" hint="Places along the volume's longest edge at which scattered light is kept: a finer grid needs more photons" value={illumination.photon_grid} min={GRID.from} max={GRID.to} sliderMax={128} step={1} testId="photon-grid" onChange={(texels) => session.edit({ illumination: { photon_grid: Math.round(texels) } }, "photon-grid")} />
      <ShadowGridField illumination={illumination} />
      <Row label="Gather" hint="Where each place of a view ray finds scattered light: in the light field, whose bands blur its direction, or in the photons around it, each by its own direction: exact for forward scattering and gloss; slower, the more photons there are">
        <NativeSelect aria-label="Where view rays find scattered light" value={illumination.gather} data={[...gatherChoices]} data-testid="photon-gather" onChange={(event) => {
          const chosen = gatherChoices.find((choice) => choice.value === event.currentTarget.value);
          if (chosen) session.edit({ illumination: { gather: chosen.value } });
        }} />
      </Row>
      <SliderField label="Bands" hint="Bands that tell from where scattered light comes; 0: as many as matter asks for" value={illumination.photon_bands} min={0} max={6} step={1} testId="photon-bands" onChange={(bands) => session.edit({ illumination: { photon_bands: Math.round(bands) } }, "photon-bands")} />
    </>
  );
}
