/** What a pixel shows: matter in light, a surface, a slice or a projection. */

import { NativeSelect, Slider } from "@mantine/core";
import { Row, Section, SliderField } from "../app/controls";
import type { RenderingMode, SlicePlane } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { valueRange, wholeValues, type Range } from "../transfer-function/valueAxis";
import { WindowRow } from "../transfer-function/WindowRow";
import { currentCamera } from "../viewport/actions";
import { halfEdges, planeFacing } from "./clipPlanes";
import { anatomicalSlices, axisNormals, gridSlices, isEdgeOn, isHounsfield, lookAtSlice, renderingModes, sliceAt, sliceAxis, slicePlace, sliceShare, tissueWindows } from "./rendering";

const editSlice = (slice: SlicePlane): void => session.edit({ rendering: { slice } });

export function RenderingPanel() {
  const rendering = useSession((state) => state.scene?.rendering);
  const window = useSession((state) => state.scene?.value_range);
  const dataset = useSession((state) => state.dataset);
  if (!rendering) return null;
  const [low, high] = dataset?.value_range ?? valueRange(window ? { value_range: window } : null, dataset);
  const [from, to] = valueRange(window ? { value_range: window } : null, dataset);
  const chosen = renderingModes.find((mode) => mode.value === rendering.mode);
  return (
    <Section id="rendering" title="Show" fields={["rendering"]}>
      <Row label="Mode" {...(chosen ? { hint: chosen.gives } : {})}>
        <NativeSelect aria-label="What is shown" value={rendering.mode} data={renderingModes.map(({ value, label }) => ({ value, label }))} data-testid="rendering-mode" onChange={(event) => choose(event.currentTarget.value as RenderingMode)} />
      </Row>
      {rendering.mode === "isosurface" && (
        <SliderField label="Value" hint="Data value of the surface; its colour is the transfer function's at this value" value={rendering.isovalue ?? 0.5 * (from + to)} min={low} max={high} step={(high - low) / 1000} digits={6} whole={wholeValues(dataset)} testId="isovalue" onChange={(isovalue) => session.edit({ rendering: { isovalue } }, "isovalue")} />
      )}
      {rendering.mode === "slice" && <SliceRows slice={rendering.slice} />}
      {rendering.mode !== "volume" && rendering.mode !== "isosurface" && <GreyWindow window={rendering.window ?? null} all={[from, to]} />}
    </Section>
  );
}

/** Which data values are black and white. */
function GreyWindow({ window, all }: { window: Range | null; all: Range }) {
  const dataset = useSession((state) => state.dataset);
  const range = window ?? all;
  const set = (to: [number, number] | null) => session.edit({ rendering: { window: to } });
  const tissue = tissueWindows.find(({ window: [low, high] }) => low === range[0] && high === range[1]);
  const chosen = window === null ? "all" : (tissue?.id ?? "own");
  return (
    <>
      <WindowRow hint="Data values that are black and white" range={range} whole={wholeValues(dataset)} testId="grey-window" onChange={set} onReset={window ? () => set(null) : null} />
      {isHounsfield(dataset) && (
        <Row label="Tissue" hint="Usual windows of CT, Hounsfield units">
          <NativeSelect
            aria-label="Window for a tissue"
            value={chosen}
            data={[{ value: "all", label: "All values" }, ...tissueWindows.map(({ id, label, window: [low, high] }) => ({ value: id, label: `${label} (${low} to ${high})` })), ...(chosen === "own" ? [{ value: "own", label: "As typed" }] : [])]}
            data-testid="grey-window-tissue"
            onChange={(event) => set(tissueWindows.find(({ id }) => id === event.currentTarget.value)?.window ?? null)}
          />
        </Row>
      )}
      <p className="note">Black and white are the ends of this window; lights and colours have no part in it.</p>
    </>
  );
}

/** Straight at the slice, as far away as before. */
const lookAt = (slice: SlicePlane): void => session.moveCamera(lookAtSlice(slice, currentCamera(), useSession.getState().dataset?.anatomical ?? false));

function choose(mode: RenderingMode): void {
  session.edit({ rendering: { mode } });
  // A slice seen edge-on is a line: nobody who asks for one means that.
  const slice = useSession.getState().scene?.rendering.slice;
  if (mode === "slice" && slice && isEdgeOn(slice, currentCamera())) lookAt(slice);
}

function SliceRows({ slice }: { slice: SlicePlane }) {
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  const edgeOn = useSession(({ scene }) => scene?.camera !== undefined && isEdgeOn(slice, scene.camera));
  const half = halfEdges(dataset, spacing);
  const names = dataset?.anatomical ? anatomicalSlices : gridSlices;
  const axis = sliceAxis(slice);
  const share = sliceShare(slice, half);
  const place = dataset && slicePlace(slice, dataset, spacing);
  const unit = dataset?.spacing_unit;
  return (
    <>
      <Row label="Plane">
        <NativeSelect
          aria-label="Plane of the slice"
          value={axis === null ? "oblique" : String(axis)}
          data={[...names.map((label, index) => ({ value: String(index), label })), ...(axis === null ? [{ value: "oblique", label: "Oblique" }] : [])]}
          data-testid="slice-plane"
          onChange={(event) => {
            const normal = axisNormals[Number(event.currentTarget.value)];
            if (!normal) return;
            editSlice({ normal, offset: 0 });
            lookAt({ normal, offset: 0 });
          }}
        />
        <button type="button" className="text-button" title="A plane straight across where you look" onClick={() => editSlice({ normal: planeFacing(currentCamera()).normal, offset: 0 })} data-testid="slice-face">Across my view</button>
      </Row>
      <Row label="Position" hint="From the volume's first face">
        <Slider
          className="row-slider"
          min={0}
          max={1}
          step={0.001}
          label={null}
          value={share}
          thumbLabel="Position of the slice"
          data-testid="slice-position"
          onChange={(to) => {
            session.beginGesture();
            editSlice(sliceAt(slice, to, half));
          }}
          onChangeEnd={() => session.endGesture()}
        />
        <span className="number clip-range">{Math.round(share * 100)} %</span>
      </Row>
      <p className="row-place number" data-testid="slice-place">
        {edgeOn ? (
          <span data-testid="slice-edge-on">Seen edge-on, as a line. <button type="button" className="text-button" onClick={() => lookAt(slice)} data-testid="slice-look">Look straight at it</button></span>
        ) : (
          <>
            {place?.slice && <span>slice {place.slice.number} of {place.slice.count}</span>}
            {place && unit !== undefined && <span>{place.length.toFixed(1)} {unit}</span>}
          </>
        )}
      </p>
    </>
  );
}
