/** Asks for the layout of a raw file. */

import { Button, NativeSelect } from "@mantine/core";
import { useState } from "react";
import { NumberField, Row } from "../app/controls";
import type { VoxelType } from "../generated/proto";
import type { Triple } from "../scene/vec";
import { guessLayout, isPacked, layoutProblem, voxelBytes } from "./grouping";
import { dismissUpload, sendWithLayout, type UploadTile } from "./store";

/** Longest edge of a raw volume, voxels. */
const MAX_EDGE = 2048;

export function RawForm({ tile }: { tile: UploadTile }) {
  const [file] = tile.group.files;
  const size = file?.size ?? 0;
  const [layout, setLayout] = useState(() => guessLayout({ name: tile.name, size }));
  const problem = layoutProblem(layout, size, isPacked(tile.name));
  const blocks = problem !== null && !problem.includes("unused");
  return (
    <form className="raw-form" data-testid="raw-form" onSubmit={(event) => {
      event.preventDefault();
      sendWithLayout(tile, layout);
    }}>
      <p className="hint">A raw file does not say how it is laid out.</p>
      <Row label="Size" hint="Voxels along x (fastest), y and z">
        <Three label="Voxels along" value={layout.dims} min={1} max={MAX_EDGE} step={1} testId="raw-dims" onChange={(dims) => setLayout({ ...layout, dims })} />
      </Row>
      <Row label="Type" hint="Type of a voxel">
        <NativeSelect aria-label="Voxel type" value={layout.type} data={Object.keys(voxelBytes)} data-testid="raw-type" onChange={(event) => setLayout({ ...layout, type: event.currentTarget.value as VoxelType })} />
      </Row>
      <Row label="Order" hint="Order of the bytes in a voxel; of no account for one byte">
        <NativeSelect aria-label="Byte order" value={layout.endian} data={[{ value: "little", label: "little-endian" }, { value: "big", label: "big-endian" }]} data-testid="raw-endian" onChange={(event) => setLayout({ ...layout, endian: event.currentTarget.value === "big" ? "big" : "little" })} />
      </Row>
      <Row label="Header" hint="Bytes to skip before the first voxel">
        <NumberField label="Bytes to skip" value={layout.header_bytes} min={0} step={1} digits={12} width={72} suffix=" B" testId="raw-header" onChange={(header_bytes) => setLayout({ ...layout, header_bytes })} />
      </Row>
      <Row label="Spacing" hint="Edges of a voxel along x, y and z">
        <Three label="Spacing along" value={layout.spacing} min={1e-9} max={1e9} step={0.1} testId="raw-spacing" onChange={(spacing) => setLayout({ ...layout, spacing })} />
      </Row>
      {problem !== null && <p className={blocks ? "note note-danger" : "note"} data-testid="raw-problem">{problem}</p>}
      <div className="tile-actions">
        <Button type="submit" disabled={blocks} data-testid="raw-upload">Upload</Button>
        <Button variant="default" onClick={() => dismissUpload(tile.id)} data-testid="raw-cancel">Cancel</Button>
      </div>
    </form>
  );
}

function Three({ label, value, min, max, step, onChange, testId }: {
  label: string;
  value: Triple;
  min: number;
  max: number;
  step: number;
  onChange: (value: Triple) => void;
  testId: string;
}) {
  return ([0, 1, 2] as const).map((axis) => (
    <NumberField key={axis} label={`${label} ${"xyz"[axis] ?? ""}`} value={value[axis]} min={min} max={max} step={step} width={46} testId={`${testId}-${axis}`} onChange={(number) => {
      const next: Triple = [...value];
      next[axis] = number;
      onChange(next);
    }} />
  ));
}
