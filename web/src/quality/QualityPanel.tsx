/** How finely the picture is sampled and how it is put on screen. */

import { NativeSelect, Switch } from "@mantine/core";
import { ColorField, NumberField, Row, Section, SliderField } from "../app/controls";
import type { Illumination, Light, Sampling, ToneMapping } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { BakeFields } from "./BakeFields";
import { hasBake } from "./bakes";
import { hasLightGrid } from "./lightGrid";
import { LightGridFields } from "./LightGridFields";
import { canBeRefined, hasPhotons, isTraced, whyNotMixed, withoutEffect } from "./methods";
import { PhotonFields } from "./PhotonFields";
import { RecordFields } from "./RecordFields";
import { whyNotExchanged } from "./records";

const MAX_SAMPLES = 4096;
const MAX_PATHS = 1 << 20;
/** Paths per pixel at the end of the slider. */
const SLIDER_PATHS = 16384;
/** Errors at the ends of the slider, percent; below the first one the picture does not stop for its error. */
const ERRORS = { from: 0.1, to: 20 };
/** Samples per pixel at the end of the slider. */
const SLIDER_SAMPLES = 256;
/** Scattering orders that can be typed; the scene's own limit. */
const MAX_ORDERS = 1_000_000;

const toneMappings: readonly { value: ToneMapping; label: string }[] = [
  { value: "neutral", label: "Neutral" },
  { value: "linear", label: "Linear, clipped" },
  { value: "reinhard", label: "Reinhard" },
];

const interpolations = [
  { value: "sampler", label: "Interpolated" },
  { value: "exact", label: "Interpolated in 32 bits" },
  { value: "nearest", label: "Nearest" },
] as const;

export function QualityPanel() {
  const sampling = useSession((state) => state.scene?.sampling);
  const film = useSession((state) => state.scene?.film);
  const background = useSession((state) => state.scene?.background);
  const filter = useSession((state) => state.scene?.volume.filter);
  const orders = useSession((state) => state.scene?.scattering.orders);
  const illumination = useSession((state) => state.scene?.illumination);
  const lights = useSession((state) => state.scene?.lights);
  const onGrid = useSession((state) => state.scene !== null && hasLightGrid(state.scene));
  const photons = useSession((state) => state.scene !== null && hasPhotons(state.scene));
  const baked = useSession((state) => state.scene !== null && hasBake(state.scene));
  const mode = useSession((state) => state.scene?.rendering.mode);
  const traced = useSession((state) => state.scene !== null && isTraced(state.scene));
  const refinable = useSession((state) => state.scene !== null && canBeRefined(state.scene));
  if (!sampling || !film || background === undefined || orders === undefined || illumination === undefined || lights === undefined) return null;
  const keptInRecords = illumination.method === "image_based" && !traced && mode === "volume";
  const ordersLack = keptInRecords ? whyNotExchanged(illumination, orders) : withoutEffect(illumination.method, "scattering orders");
  return (
    <Section id="quality" title="Quality" fields={["sampling", "film", "background", "volume", "scattering", "illumination"]}>
      {traced ? <TracingFields illumination={illumination} lights={lights} /> : <RayFields sampling={sampling} />}
      {photons && <PhotonFields illumination={illumination} />}
      {onGrid && <LightGridFields illumination={illumination} scatteredOnce={orders === 1} />}
      {baked && <BakeFields illumination={illumination} />}
      {keptInRecords && <RecordFields illumination={illumination} />}
      {refinable && <RefinementFields illumination={illumination} />}
      <Row label="Empty space" hint="Skips regions without matter; never changes the picture">
        <Switch checked={sampling.skip_empty} label="Skip" data-testid="skip-empty" onChange={(event) => session.edit({ sampling: { skip_empty: event.currentTarget.checked } })} />
      </Row>
      <Row label="Voxels" hint="How values between voxel centres are found; nearest is for labels">
        <NativeSelect aria-label="Interpolation" value={filter === "nearest" ? "nearest" : sampling.interpolation} data={[...interpolations]} data-testid="filter" onChange={(event) => {
          const chosen = event.currentTarget.value;
          session.edit(chosen === "nearest" ? { volume: { filter: chosen } } : { volume: { filter: "linear" }, sampling: { interpolation: chosen } });
        }} />
      </Row>
      <Row label="Scattering" hint="How often light may scatter on its way">
        <NativeSelect aria-label="Scattering orders" value={orders === "all" ? "all" : orders === 1 ? "single" : "some"} data={[{ value: "all", label: "All orders" }, { value: "single", label: "Single" }, { value: "some", label: "At most" }]} data-testid="scattering" onChange={(event) => {
          const chosen = event.currentTarget.value;
          session.edit({ scattering: { orders: chosen === "all" ? "all" : chosen === "single" ? 1 : 4 } });
        }} />
        {orders !== "all" && orders !== 1 && <NumberField label="Most orders" value={orders} min={1} max={MAX_ORDERS} step={1} width={58} testId="scattering-orders" onChange={(count) => session.edit({ scattering: { orders: Math.round(count) } }, "orders")} />}
      </Row>
      {ordersLack !== null && <p className="hint row-hint" data-testid="scattering-note">{ordersLack}</p>}
      <SliderField label="Exposure" hint="Stops: each doubles the light" value={film.exposure_stops} min={-20} max={20} sliderMax={6} step={0.1} toSlider={(x) => Math.max(-6, x)} testId="exposure" onChange={(exposure_stops) => session.edit({ film: { exposure_stops } }, "exposure")} />
      <Row label="Tone map" hint="How radiance becomes brightness on the screen">
        <NativeSelect aria-label="Tone mapping" value={film.tone_mapping} data={[...toneMappings]} data-testid="tone-mapping" onChange={(event) => session.edit({ film: { tone_mapping: event.currentTarget.value } })} />
      </Row>
      <Row label="Background">
        {background !== "environment" && <ColorField label="Background" color={background} testId="background" onChange={(color) => session.edit({ background: color }, "background")} />}
        <Switch checked={background === "environment"} label="Environment" data-testid="background-environment" onChange={(event) => session.edit({ background: event.currentTarget.checked ? "environment" : [0, 0, 0] })} />
      </Row>
    </Section>
  );
}

/** Sampling of rays that are cast. */
function RayFields({ sampling }: { sampling: Sampling }) {
  return (
    <>
        <SliderField label="Step" hint="Longest part of a ray that is computed at once, in smallest voxel edges" value={sampling.step_voxels} min={1 / 16} max={8} step={0.05} toSlider={Math.log2} fromSlider={(x) => 2 ** x} testId="step-voxels" onChange={(step_voxels) => session.edit({ sampling: { step_voxels } }, "step")} />
        <SliderField label="Samples" hint="Jittered passes per pixel that are accumulated at rest" value={sampling.samples_per_pixel} min={1} max={MAX_SAMPLES} sliderMax={SLIDER_SAMPLES} step={1} toSlider={Math.log2} fromSlider={(x) => Math.round(2 ** x)} digits={4} testId="samples-per-pixel" onChange={(samples) => session.edit({ sampling: { samples_per_pixel: Math.round(samples) } }, "samples")} />
    </>
  );
}

/** Whether paths refine the picture, and until when. */
function RefinementFields({ illumination }: { illumination: Illumination }) {
  return (
    <>
      <Row label="At rest" hint="Follows paths beneath the finished picture, which goes over to what they find as far as it is known better. Starts again with every change.">
        <Switch checked={illumination.refine} label="Refine by paths" data-testid="refine" onChange={(event) => session.edit({ illumination: { refine: event.currentTarget.checked } })} />
      </Row>
      {illumination.refine && <PathFields illumination={illumination} />}
    </>
  );
}

/** When the path tracer has done enough, and whether it keeps lights apart. */
function TracingFields({ illumination, lights }: { illumination: Illumination; lights: readonly Light[] }) {
  const notMixed = whyNotMixed(lights);
  return (
    <>
      <PathFields illumination={illumination} />
      <Row label="Lights" hint="Keeps what each light brings apart: colours, strengths, switches and the background then change the finished picture at once. Costs memory for every light and time for those that are off, and starts the picture again.">
        <Switch checked={illumination.light_layers} disabled={notMixed !== null && !illumination.light_layers} label="Mix after rendering" data-testid="light-layers" onChange={(event) => session.edit({ illumination: { light_layers: event.currentTarget.checked } })} />
      </Row>
      {notMixed !== null && <p className="hint row-hint" data-testid="light-layers-note">{notMixed}</p>}
    </>
  );
}

/** When paths have done enough. */
function PathFields({ illumination }: { illumination: Illumination }) {
  const percent = illumination.max_error * 100;
  return (
    <>
      <SliderField label="Paths" hint="Paths of light per pixel that are followed at rest" value={illumination.paths_per_pixel} min={1} max={MAX_PATHS} sliderMax={SLIDER_PATHS} step={1} toSlider={Math.log2} fromSlider={(x) => Math.round(2 ** x)} whole testId="paths-per-pixel" onChange={(paths) => session.edit({ illumination: { paths_per_pixel: Math.round(paths) } }, "paths")} />
      <SliderField label="Stop at error" hint="Percent: the picture is final once its standard error is this small, or all paths are followed; 0 waits for all paths" value={percent} min={0} max={100} sliderMax={ERRORS.to} step={0.1} toSlider={(x) => Math.log2(Math.max(ERRORS.from, x))} fromSlider={(x) => (2 ** x <= ERRORS.from ? 0 : 2 ** x)} testId="max-error" onChange={(error) => session.edit({ illumination: { max_error: error / 100 } }, "error")} />
    </>
  );
}
