/** One tile for each upload: progress, then what was recognised or why it was refused. */

import { Button, Progress } from "@mantine/core";
import { IconButton } from "../app/controls";
import type { Dataset } from "../generated/proto";
import { facts, formatBytes } from "./format";
import { RawForm } from "./RawForm";
import { dismissUpload, explore, retryUpload, useDatasets, type UploadTile } from "./store";

/** Most files a tile names. */
const MAX_NAMES = 8;

export function UploadTiles() {
  const uploads = useDatasets((state) => state.uploads);
  return uploads.map((tile) => (
    <div key={tile.id} className="tile" data-testid="upload" data-state={tile.state.kind} data-name={tile.name}>
      <div className="tile-head">
        <span className="tile-name" title={namesOf(tile)}>{tile.name}</span>
        {tile.group.files.length > 1 && <span className="dim">{tile.group.files.length} files</span>}
        {(tile.state.kind === "done" || tile.state.kind === "failed") && <IconButton icon="close" label="Put away" testId="upload-dismiss" onClick={() => dismissUpload(tile.id)} />}
      </div>
      <TileBody tile={tile} />
    </div>
  ));
}

/** Names of a tile's files; of a series the first ones. */
const namesOf = ({ group: { files } }: UploadTile): string =>
  files.slice(0, MAX_NAMES).map((file) => file.name).join(", ") + (files.length > MAX_NAMES ? ", …" : "");

/** Opens what was uploaded; from then on its place is the list. */
async function open(tile: number, dataset: string): Promise<void> {
  if ((await explore(dataset)) === null) dismissUpload(tile);
}

function TileBody({ tile }: { tile: UploadTile }) {
  const { state } = tile;
  switch (state.kind) {
    case "layout":
      return <RawForm tile={tile} />;
    case "sending": {
      const { sent, total, bytesPerSecond } = state.progress;
      const percent = total > 0 ? (sent / total) * 100 : 0;
      return (
        <>
          <Progress value={percent} size={3} aria-label="Upload" />
          <div className="tile-line">
            <span className="number" data-testid="upload-progress">{Math.floor(percent)} %</span>
            <span className="number dim">{formatBytes(sent)} of {formatBytes(total)}</span>
            <span className="number dim">{formatBytes(bytesPerSecond)}/s</span>
            <button type="button" className="text-button" onClick={state.cancel} data-testid="upload-cancel">Cancel</button>
          </div>
        </>
      );
    }
    case "checking":
      return (
        <>
          <Progress value={100} size={3} animated aria-label="The service reads the file" />
          <div className="tile-line"><span className="dim">The service reads the file …</span></div>
        </>
      );
    case "done":
      return (
        <>
          <DatasetFacts dataset={state.dataset} />
          <div className="tile-actions">
            <Button onClick={() => void open(tile.id, state.dataset.id)} data-testid="upload-explore">Explore</Button>
          </div>
        </>
      );
    case "failed":
      return (
        <>
          <p className="note note-danger" role="alert" data-testid="upload-error">{state.message}</p>
          <div className="tile-actions">
            <Button variant="default" onClick={() => retryUpload(tile)} data-testid="upload-retry">Try again</Button>
          </div>
        </>
      );
  }
}

/** What was recognised, and what the reader wants to be known. */
export function DatasetFacts({ dataset }: { dataset: Dataset }) {
  return (
    <>
      <dl className="facts" data-testid="dataset-facts">
        {facts(dataset).map(([name, value]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      {dataset.notices.map((notice) => <p key={notice} className="note">{notice}</p>)}
      {dataset.attribution !== undefined && <p className="hint">{dataset.attribution}</p>}
    </>
  );
}
