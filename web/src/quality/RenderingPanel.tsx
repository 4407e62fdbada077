/** What a pixel shows: matter in light, a surface, a slice or a projection. */

import { NativeSelect, Slider } from "@mantine/core";
import { Row, Section, SliderField } from "../app/controls";
import type { RenderingMode, SlicePlane } from "../generated/proto";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { valueRange } from "../transfer-function/valueAxis";
import { currentCamera } from "../viewport/actions";
import { halfEdges, planeFacing } from "./clipPlanes";
import { anatomicalSlices, axisNormals, gridSlices, renderingModes, sliceAt, sliceAxis, sliceShare } from "./rendering";

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
        <NativeSelect aria-label="What is shown" value={rendering.mode} data={renderingModes.map(({ value, label }) => ({ value, label }))} data-testid="rendering-mode" onChange={(event) => session.edit({ rendering: { mode: event.currentTarget.value as RenderingMode } })} />
      </Row>
      {rendering.mode === "isosurface" && (
        <SliderField label="Value" hint="Data value of the surface; its colour is the transfer function's at this value" value={rendering.isovalue ?? 0.5 * (from + to)} min={low} max={high} step={(high - low) / 1000} digits={6} testId="isovalue" onChange={(isovalue) => session.edit({ rendering: { isovalue } }, "isovalue")} />
      )}
      {rendering.mode === "slice" && <SliceRows slice={rendering.slice} />}
      {rendering.mode !== "volume" && rendering.mode !== "isosurface" && <p className="note">Black and white are the ends of the window, below. Lights and colours have no part in it.</p>}
    </Section>
  );
}

function SliceRows({ slice }: { slice: SlicePlane }) {
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  const half = halfEdges(dataset, spacing);
  const names = dataset?.anatomical ? anatomicalSlices : gridSlices;
  const axis = sliceAxis(slice);
  const share = sliceShare(slice, half);
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
            if (normal) editSlice({ normal, offset: 0 });
          }}
        />
        <button type="button" className="text-button" title="A plane straight across where you look" onClick={() => editSlice({ normal: planeFacing(currentCamera()).normal, offset: 0 })} data-testid="slice-face">Face me</button>
      </Row>
      <Row label="Position">
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
    </>
  );
}
