/** One tile for each upload: progress, then what was recognised or why it was refused. */

import { Button, FileButton, Progress } from "@mantine/core";
import type { ReactNode } from "react";
import { IconButton } from "../app/controls";
import { sayError } from "../app/say";
import type { Dataset } from "../generated/proto";
import { facts, formatBytes } from "./format";
import { RawForm } from "./RawForm";
import { timeLeft } from "./resumable";
import { cancelUpload, dismissUpload, explore, retryUpload, takeFiles, useDatasets, type UploadTile } from "./store";
import type { Progress as Amount } from "./upload";

/** Most files a tile names. */
const MAX_NAMES = 8;
/** Browser tests put files here. */
const againInput = { "data-testid": "upload-again-input" } as object;

export function UploadTiles() {
  const uploads = useDatasets((state) => state.uploads);
  return uploads.map((tile) => (
    <div key={tile.id} className="tile" data-testid="upload" data-state={tile.state.kind} data-name={tile.name}>
      <div className="tile-head">
        <span className="tile-name" title={namesOf(tile)}>{tile.name}</span>
        {tile.group.files.length > 1 && <span className="dim">{tile.group.files.length} files</span>}
        {(tile.state.kind === "done" || (tile.state.kind === "failed" && !tile.state.kept)) && <IconButton icon="close" label="Put away" testId="upload-dismiss" onClick={() => dismissUpload(tile.id)} />}
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
      return (
        <>
          <Bar {...state.progress} />
          <div className="tile-line">
            {state.waiting
              ? <span className="dim" role="status" title="The connection broke; what was sent is kept" data-testid="upload-waiting">Reconnecting …</span>
              : <span className="number dim">{formatBytes(bytesPerSecond)}/s{bytesPerSecond > 0 && `, ${timeLeft(total - sent, bytesPerSecond)}`}</span>}
            <Actions>
              <button type="button" className="text-button" onClick={() => tile.transfer?.pause()} data-testid="upload-pause">Pause</button>
              <Cancel tile={tile} />
            </Actions>
          </div>
        </>
      );
    }
    case "paused":
      return (
        <>
          <Bar {...state.progress} />
          <div className="tile-line">
            <span className="dim" title="What was sent is kept, also when the page is closed">Paused and kept</span>
            <Actions>
              <button type="button" className="text-button" onClick={() => tile.transfer?.goOn()} data-testid="upload-resume">Go on</button>
              <Cancel tile={tile} />
            </Actions>
          </div>
        </>
      );
    case "left":
      return (
        <>
          <Bar sent={state.sent} total={state.total} />
          <p className="hint" data-testid="upload-left">The page was loaded anew and cannot reach your file any more. Choose or drop the same file again: it goes on from here.</p>
          <div className="tile-actions">
            <FileButton multiple inputProps={againInput} onChange={(files) => void takeFiles(files).catch(sayError)}>
              {(props) => <Button {...props} data-testid="upload-again">Choose again</Button>}
            </FileButton>
            <Button variant="default" onClick={() => void cancelUpload(tile)} data-testid="upload-discard">Discard</Button>
          </div>
        </>
      );
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
            {(state.kept || tile.group.files.length > 0) && (
              <Button variant="default" onClick={() => retryUpload(tile)} data-testid="upload-retry">{state.kept ? "Go on" : "Try again"}</Button>
            )}
            {state.kept && <Button variant="default" onClick={() => void cancelUpload(tile)} data-testid="upload-discard">Discard</Button>}
          </div>
        </>
      );
  }
}

/** How much is at the service. */
function Bar({ sent, total }: Pick<Amount, "sent" | "total">) {
  const percent = total > 0 ? (sent / total) * 100 : 0;
  return (
    <>
      <Progress value={percent} size={3} aria-label="Upload" />
      <div className="tile-line">
        <span className="number" data-testid="upload-progress">{Math.floor(percent)} %</span>
        <span className="number dim">{formatBytes(sent)} of {formatBytes(total)}</span>
      </div>
    </>
  );
}

const Actions = ({ children }: { children: ReactNode }) => <span className="tile-buttons">{children}</span>;

const Cancel = ({ tile }: { tile: UploadTile }) => (
  <button type="button" className="text-button" onClick={() => void cancelUpload(tile)} data-testid="upload-cancel">Cancel</button>
);

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
