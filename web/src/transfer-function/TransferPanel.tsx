/** The transfer function: editor, presets, the selected point, window and density. */

import { SegmentedControl } from "@mantine/core";
import { useMemo, useState } from "react";
import { Row, Section, SliderField } from "../app/controls";
import { useUi } from "../app/uiStore";
import { session } from "../session/engine";
import { useSession } from "../session/store";
import { select } from "./curve";
import { ColourMaps, CurveMenu } from "./CurveMenu";
import { Editor } from "./Editor";
import { useRegionHistogram } from "./inView";
import { PointFields } from "./PointFields";
import { Presets } from "./Presets";
import { ontoRange } from "./reframe";
import { valueOf, valueRange, wholeValues } from "./valueAxis";
import { WindowRow } from "./WindowRow";

/** Largest density of the slider and of the number. */
const SLIDER_DENSITY = 10;
const MAX_DENSITY = 1e6;

export function TransferPanel() {
  const points = useSession((state) => state.scene?.transfer_function.points);
  const dataset = useSession((state) => state.dataset);
  const histogram = useSession((state) => state.histogram);
  const window = useSession((state) => state.scene?.value_range);
  const density = useSession((state) => state.scene?.density ?? 1);
  const selected = useUi((ui) => ui.selectedPoints);
  const log = useUi((ui) => ui.logHistogram);
  const axis = useUi((ui) => ui.opacityAxis);
  const inView = useUi((ui) => ui.histogramInView);
  const region = useRegionHistogram(inView);
  const [focusRequest, setFocusRequest] = useState(0);
  const range = useMemo(() => valueRange(window ? { value_range: window } : null, dataset), [window, dataset]);

  if (!points) return null;
  const whole = wholeValues(dataset);
  // The points keep their data values; null: all values of the data.
  const setWindow = (to: [number, number] | null) => {
    const kept = ontoRange(points, range, to ?? valueRange(null, dataset));
    session.edit({ value_range: to, transfer_function: { points: kept } });
    if (kept.length !== points.length) select([]);
  };
  const selectedPoint = selected.length === 1 ? points[selected[0] ?? -1] : undefined;
  return (
    <Section
      id="transfer"
      title="Transfer function"
      fields={["transfer_function", "value_range", "density"]}
      actions={(
        <div className="section-actions tf-actions">
          <ColourMaps />
          <Presets histogram={histogram} range={range} surfaceValue={selectedPoint && valueOf(selectedPoint.s, range)} />
          <CurveMenu />
        </div>
      )}
    >
      <Editor key={dataset?.id} points={points} histogram={histogram} shown={region ?? histogram} range={range} whole={whole} onNumbers={() => setFocusRequest((n) => n + 1)} />
      <Row label="Histogram" hint="Grey columns: how many voxels have each value, of all or of what the clip box and planes leave in view; logarithmic shows rare values, too">
        <SegmentedControl className="row-choice" value={inView ? "view" : "all"} data={[{ value: "all", label: "All" }, { value: "view", label: "In view" }]} onChange={(value) => useUi.setState({ histogramInView: value === "view" })} data-testid="tf-histogram-part" />
        <SegmentedControl className="row-choice" value={log ? "log" : "linear"} data={[{ value: "log", label: "Log" }, { value: "linear", label: "Linear" }]} onChange={(value) => useUi.setState({ logHistogram: value === "log" })} data-testid="tf-histogram-scale" />
      </Row>
      <Row label="Opacity axis" hint="Height of the points: even, or with more room for small opacities">
        <SegmentedControl className="row-choice" value={axis} data={[{ value: "power", label: "Spread near 0" }, { value: "linear", label: "Linear" }]} onChange={(value) => useUi.setState({ opacityAxis: value === "power" ? "power" : "linear" })} data-testid="tf-opacity-axis" />
      </Row>
      <PointFields points={points} range={range} whole={whole} focusRequest={focusRequest} />
      <SliderField label="Density" hint="Multiplies the extinction of every point" value={density} min={0} max={MAX_DENSITY} sliderMax={SLIDER_DENSITY} step={0.05} toSlider={Math.sqrt} fromSlider={(x) => x * x} testId="density" onChange={(value) => session.edit({ density: value }, "density")} />
      <WindowRow hint="Data values at the ends of the transfer function" range={range} whole={whole} testId="window" onChange={setWindow} onReset={window ? () => setWindow(null) : null} />
    </Section>
  );
}
