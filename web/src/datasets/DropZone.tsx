/** Files may be dropped anywhere on the page. */

import { useEffect, useState } from "react";
import { sayError } from "../app/say";
import { useUi } from "../app/uiStore";
import { droppedFiles } from "./dropped";
import { takeFiles } from "./store";

export function DropZone() {
  const [over, setOver] = useState(false);
  useEffect(() => {
    // Enter and leave come for every element on the way; the depth tells when the page is left.
    let depth = 0;
    const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    const enter = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      depth += 1;
      setOver(true);
    };
    const leave = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      depth -= 1;
      if (depth <= 0) setOver(false);
    };
    const hover = (event: DragEvent) => {
      if (hasFiles(event)) event.preventDefault();
    };
    const drop = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      depth = 0;
      setOver(false);
      useUi.setState({ leftOpen: true });
      if (event.dataTransfer) void droppedFiles(event.dataTransfer).then(takeFiles).catch(sayError);
    };
    const listening = new AbortController();
    const { signal } = listening;
    window.addEventListener("dragenter", enter, { signal });
    window.addEventListener("dragleave", leave, { signal });
    window.addEventListener("dragover", hover, { signal });
    window.addEventListener("drop", drop, { signal });
    return () => listening.abort();
  }, []);
  if (!over) return null;
  return (
    <div className="drop-zone" data-testid="drop-zone">
      <div>
        <strong>Drop to upload</strong>
        <span>A header and its data, or the slices of a series, are one dataset. A scene file opens.</span>
      </div>
    </div>
  );
}
