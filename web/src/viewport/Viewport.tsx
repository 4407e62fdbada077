/** The picture and what lies over it. */

import { useEffect, useRef, useState } from "react";
import { IconButton } from "../app/controls";
import { saveStill } from "../app/files";
import { sayError } from "../app/say";
import { useUi } from "../app/uiStore";
import { useDatasets } from "../datasets/store";
import { LightGizmo } from "../lights/LightGizmo";
import { ClipHandles } from "../quality/ClipHandles";
import { session } from "../session/engine";
import { isWatching, pictureState, useSession } from "../session/store";
import { currentCamera, resetView, startUp, toggleFullScreen, toggleProjection } from "./actions";
import { EdgeLetters } from "./EdgeLetters";
import { attachGestures } from "./gestures";
import { LightMark } from "./LightMark";
import { OrientationCube } from "./OrientationCube";
import { Presenter } from "./presenter";
import { ProbeLayer } from "./ProbeLayer";
import { scaleBar, unitsPerWorld } from "./scaleBar";
import { moveWindow, toggleWindowing, useWindowing } from "./windowing";
import { WindowReadout } from "./WindowReadout";

export function Viewport() {
  const frame = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [size, setSize] = useState({ width: 0, height: 0 });

  useEffect(() => {
    const element = canvas.current;
    const parent = frame.current;
    if (!element || !parent) return;
    const presenter = new Presenter(element);
    session.present(presenter);
    const detach = attachGestures(element, {
      camera: currentCamera,
      startUp,
      move: (camera) => session.moveCamera(camera),
      window: { active: () => useWindowing.getState().active, begin: () => session.beginGesture(), move: moveWindow, end: () => session.endGesture() },
    });

    const measure = () => {
      const { clientWidth: width, clientHeight: height } = parent;
      if (width === 0 || height === 0) return;
      const pixelRatio = window.devicePixelRatio || 1;
      presenter.resize(Math.round(width * pixelRatio), Math.round(height * pixelRatio));
      session.resize({ width, height, pixel_ratio: pixelRatio });
      setSize({ width, height });
    };
    const observer = new ResizeObserver(measure);
    observer.observe(parent);
    window.addEventListener("resize", measure);
    return () => {
      observer.disconnect();
      window.removeEventListener("resize", measure);
      detach();
      session.present(null);
    };
  }, []);

  const state = useSession(pictureState);
  const watching = useSession(isWatching);
  const windowing = useWindowing(({ active }) => active);
  return (
    <div className="viewport" ref={frame} data-state={state}>
      <canvas ref={canvas} className="viewport-canvas" tabIndex={0} aria-label="Rendered volume: drag to turn, wheel to zoom" data-testid="viewport" data-state={state} data-tool={windowing ? "window" : undefined} />
      <ProbeLayer canvas={canvas} viewport={size} />
      <WindowReadout />
      {!watching && <ClipHandles viewport={size} />}
      {!watching && <LightGizmo viewport={size} />}
      <EdgeLetters />
      <LoadingMark />
      <LightMark />
      <OrientationCube />
      <Scale viewportHeight={size.height} />
      <ViewTools />
    </div>
  );
}

function ViewTools() {
  const windowing = useWindowing(({ active }) => active);
  const clipping = useUi((ui) => ui.clipHandles);
  const watching = useSession(isWatching);
  const orthographic = useSession((state) => state.scene?.camera?.orthographic_height !== undefined);
  return (
    <div className="view-tools">
      <IconButton icon="home" label="Back to the starting view" hotkey="R" onClick={resetView} testId="reset-view" />
      <IconButton icon={orthographic ? "orthographic" : "perspective"} label={orthographic ? "Orthographic: change to perspective" : "Perspective: change to orthographic"} active={orthographic} onClick={toggleProjection} testId="toggle-projection" />
      {!watching && <IconButton icon="contrast" label="Window and level: drag across for the width, up and down for the middle" hotkey="W" active={windowing} onClick={toggleWindowing} testId="toggle-windowing" />}
      {!watching && <IconButton icon="box" label="Clip box and planes: handles in the picture" hotkey="C" active={clipping} onClick={() => useUi.setState({ clipHandles: !clipping })} testId="toggle-clip-handles" />}
      <IconButton icon="camera" label={watching ? "Save the picture on screen as PNG; stills drawn by the server are for editors" : "Save a still as PNG"} hotkey="S" onClick={() => void saveStill()} testId="save-still" />
      <IconButton icon="turntable" label="Turntable or film: the view moves, as a file" hotkey="T" onClick={() => useUi.setState({ turntableOpen: true })} testId="turntable-open" />
      <IconButton icon="expand" label="Full screen" hotkey="F" onClick={() => void toggleFullScreen().catch(sayError)} testId="full-screen" />
    </div>
  );
}

function Scale({ viewportHeight }: { viewportHeight: number }) {
  const camera = useSession((state) => state.scene?.camera);
  const dataset = useSession((state) => state.dataset);
  const spacing = useSession((state) => state.scene?.spacing);
  const units = unitsPerWorld(dataset, spacing);
  const bar = camera && units !== null ? scaleBar(camera, viewportHeight, units, dataset?.spacing_unit ?? "") : null;
  if (!bar || viewportHeight === 0) return null;
  return (
    <div className="scale-bar" style={{ width: bar.pixels }} data-testid="scale-bar" title="Length at the depth of the pivot">
      {bar.label}
    </div>
  );
}

/** A quiet mark while something loads or the connection is away. */
function LoadingMark() {
  const progress = useSession((state) => state.progress);
  const link = useSession((state) => state.link);
  const failure = useSession((state) => state.failure);
  const notice = useSession((state) => state.notice);
  // The picture before stays while a dataset is being opened.
  const opening = useDatasets((state) => state.list.find(({ id }) => id === state.opening)?.name ?? null);
  const waiting = useSession((state) => state.awaitingPicture);
  const retryAt = useSession((state) => state.retryAt);
  const seconds = useCountdown(retryAt);

  if (link === "lost" || link === "failed") {
    const words = link === "failed" ? (failure ?? "The session could not be opened.") : (failure ?? "The connection is lost. Your scene is kept.");
    return (
      <div className="mark mark-offline" role="status" data-testid="offline-mark">
        <span>{words}</span>
        {link === "lost" && (
          <button type="button" className="text-button" onClick={() => session.retryNow()} data-testid="retry-now">
            {seconds > 0 ? `Trying again in ${seconds} s` : "Trying …"}
          </button>
        )}
      </div>
    );
  }
  if (failure !== null) {
    return (
      <div className="mark mark-offline" role="alert" data-testid="failure-mark">
        <span>{failure}</span>
        <button type="button" className="text-button" onClick={() => useSession.setState({ failure: null })}>Dismiss</button>
      </div>
    );
  }
  if (notice !== null && !progress && !waiting && opening === null) {
    return (
      <div className="mark mark-offline" role="status" data-testid="notice-mark">
        <span>{notice}</span>
        <button type="button" className="text-button" onClick={() => useSession.setState({ notice: null })} data-testid="notice-dismiss">Dismiss</button>
      </div>
    );
  }
  if (!progress && !waiting && opening === null) return null;
  const fraction = progress && progress.fraction >= 0 ? progress.fraction : null;
  return (
    <div className="mark" role="status" data-testid="loading-mark">
      <span className="mark-pulse" />
      <span>{progress?.activity ?? (opening === null ? "Opening" : `Opening ${opening}`)}</span>
      {fraction !== null && <span className="number">{Math.round(fraction * 100)} %</span>}
    </div>
  );
}

/** Whole seconds until `at`. */
function useCountdown(at: number | null): number {
  const [now, setNow] = useState(() => Date.now());
  useEffect(() => {
    if (at === null) return;
    const timer = window.setInterval(() => setNow(Date.now()), 250);
    return () => window.clearInterval(timer);
  }, [at]);
  return at === null ? 0 : Math.max(0, Math.ceil((at - now) / 1000));
}
