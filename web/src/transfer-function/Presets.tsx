/** Transfer functions made for this volume: what each makes of it, and its curve over the histogram. */

import { Button, Popover } from "@mantine/core";
import { useId, useMemo, useState } from "react";
import type { Histogram } from "../generated/proto";
import { hexFromLinear } from "../scene/colour";
import type { Patch } from "../scene/mergePatch";
import { session } from "../session/engine";
import { select } from "./curve";
import { areaUnder, columnsPath, curvePath, type Plot } from "./geometry";
import { PresetPicture } from "./PresetPicture";
import { presetsFor, type Preset } from "./presets";
import { histogramColumns, valueOf, type Range } from "./valueAxis";

/** Size of the curve, CSS pixels. */
const WIDTH = 92;
const HEIGHT = 60;

/** What a preset changes of the scene. */
const patchOf = ({ points, materials }: Preset): Patch => ({ transfer_function: { points }, ...(Object.keys(materials).length > 0 ? { materials } : {}) });

function apply(preset: Preset): void {
  session.edit(patchOf(preset));
  select([]);
}

export function Presets({ histogram, range, surfaceValue }: {
  histogram: Histogram | null;
  range: Range;
  /** Data value of the selected point: where the surface preset puts its surface. */
  surfaceValue: number | undefined;
}) {
  const [opened, setOpened] = useState(false);
  const presets = useMemo(
    () => (histogram && opened ? presetsFor(histogram, range, surfaceValue) : []),
    [histogram, range, surfaceValue, opened],
  );
  return (
    <Popover opened={opened} onChange={setOpened} position="bottom-end" withinPortal>
      <Popover.Target>
        <Button variant="default" size="compact-xs" disabled={!histogram} onClick={() => setOpened((is) => !is)} data-testid="tf-presets">Presets</Button>
      </Popover.Target>
      <Popover.Dropdown p={6}>
        <div className="presets">
          {presets.map((preset) => (
            <button key={preset.id} type="button" className="preset" title={preset.hint} data-testid={`preset-${preset.id}`} onClick={() => {
              apply(preset);
              setOpened(false);
            }}>
              <PresetPicture patch={patchOf(preset)} />
              {histogram && <PresetDrawing preset={preset} histogram={histogram} range={range} />}
              <span className="preset-name">{preset.id === "surface" && surfaceValue !== undefined ? "Surface at point" : preset.label}</span>
            </button>
          ))}
        </div>
      </Popover.Dropdown>
    </Popover>
  );
}

function PresetDrawing({ preset, histogram, range }: { preset: Preset; histogram: Histogram; range: Range }) {
  const id = useId();
  const plot: Plot = { left: 0, top: 2, width: WIDTH, height: HEIGHT - 2, window: [0, 1], axis: "power", ceiling: 1 };
  const curve = curvePath(plot, preset.points);
  const columns = histogramColumns(histogram, [valueOf(0, range), valueOf(1, range)], WIDTH / 2, true);
  return (
    <svg width={WIDTH} height={HEIGHT} aria-hidden="true">
      <linearGradient id={id} gradientUnits="userSpaceOnUse" x1={0} x2={WIDTH}>
        {preset.points.map((point, index) => <stop key={index} offset={point.s} stopColor={hexFromLinear(point.albedo)} />)}
      </linearGradient>
      <path className="tf-histogram" d={columnsPath(plot, columns)} />
      <path d={areaUnder(plot, curve)} fill={`url(#${id})`} className="tf-area" />
      <path className="tf-curve" d={curve} />
    </svg>
  );
}
