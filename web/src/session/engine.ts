/**
 * The session: opens it, keeps the connection, sends inputs, takes scenes and pictures.
 *
 * Inputs are sent once per animation frame, newest state only. A lost connection is retried with
 * growing pauses for as long as the page is open; a session that is gone is made anew from the
 * scene on screen.
 */

import * as rest from "../api/rest";
import {
  PROTOCOL_VERSION, decodeFrameHeader, type Camera, type CreateSession, type FrameHeader, type SceneFile, type ServerMessage,
} from "../generated/proto";
import { deepEqual, type Patch } from "../scene/mergePatch";
import { forAspect } from "../viewport/camera";
import { CameraTrail } from "./cameraTrail";
import { Connection } from "./connection";
import { EditLog } from "./edits";
import { FrameReceiver } from "./frames";
import { Inputs, type ViewportSize } from "./inputs";
import { EditMeter } from "./editWork";
import { LightMeter } from "./lightMeter";
import { Meters } from "./meters";
import { rememberSession } from "./ownSessions";
import { decodeScene, parseAddress, sessionAddress } from "./shareLink";
import { isInOwnLight, isWatching, reported, sinceEpoch, useSession, type SessionState } from "./store";
import { SceneSync } from "./sync";
import { loadView, saveView } from "./viewMemory";
import { VolumeFacts } from "./volumeFacts";
import { rootOf, wordsOf } from "./words";

/** How often the readings in the status line change, milliseconds. */
const READINGS_MILLIS = 250;
/** Longest wait for the server to confirm the camera before a still is asked for, milliseconds. */
const SETTLE_MILLIS = 3000;
/** After this long without an input the view is at rest, milliseconds. */
const REST_MILLIS = 250;

/** Where pictures are shown. */
interface Screen {
  show: (picture: ImageBitmap, header: FrameHeader) => void;
  /** What is on it, as PNG. */
  still: () => Promise<Blob>;
}

const SESSION_EXPIRED =
  "The session of this link has expired: a session ends when nobody has looked at it for some time. The first sample is shown instead; a link to the scene (Share) does not expire.";
const WATCHED_ENDED = "The session you watched has ended. This is a session of your own, with what you saw last.";

const set = (state: Partial<SessionState>): void => useSession.setState(state);

class Engine {
  private sync: SceneSync | null = null;
  private edits = new EditLog();
  /** Null until the server has greeted this connection. */
  private cameras: CameraTrail | null = null;
  private readonly volume = new VolumeFacts();
  private readonly meters = new Meters();
  private readonly editMeter = new EditMeter();
  private readonly lightMeter = new LightMeter();
  private receiver: FrameReceiver<ImageBitmap> | null = null;
  /** The server has greeted this connection: inputs may be sent. */
  private welcomed = false;
  private screen: Screen | null = null;
  private settleWaiters: (() => void)[] = [];
  private restTimer: number | undefined;
  /** Grows with every session that is asked for; answers to older wishes are dropped. */
  private wish = 0;
  private readonly connection = new Connection({
    message: (message) => this.takeMessage(message),
    picture: (buffer) => this.takeFrame(buffer),
    lost: () => {
      this.forgetConnection();
      set({ link: "lost", progress: null });
    },
    gone: () => void this.recreate(),
    foreign: () => this.refuseProtocol(),
    waiting: (retryAt) => set({ retryAt }),
  });
  private readonly inputs = new Inputs({
    scene: () => (this.welcomed ? this.sync : null),
    send: (message) => {
      if (message.type === "patch") this.editMeter.sent(message.seq, performance.now());
      this.connection.send(message);
    },
    numbered: (seq) => this.numbered(seq),
    cameraSent: (seq, camera) => this.cameras?.sent(seq, camera),
  });

  /** Opens what the address asks for, else the first dataset the service offers. */
  start(): void {
    window.addEventListener("hashchange", () => void this.followAddress());
    window.addEventListener("pagehide", () => this.rememberView());
    window.addEventListener("online", () => this.connection.retryNow());
    document.addEventListener("visibilitychange", () => {
      this.connection.send({ type: "visible", visible: !document.hidden });
      if (!document.hidden) this.connection.retryNow();
    });
    // A drag ends with its pointer wherever it is let go, also outside the control it began in.
    for (const end of ["pointerup", "pointercancel", "keyup"]) window.addEventListener(end, () => window.setTimeout(() => this.endGesture()));
    window.setInterval(() => this.publishReadings(), READINGS_MILLIS);
    void this.refreshStatus();
    void this.followAddress();
  }

  /** Where decoded pictures go; null while there is no canvas. */
  present(screen: Screen | null): void {
    this.screen = screen;
  }

  openDataset(id: string): Promise<void> {
    return this.open({ dataset: id });
  }

  openScene(scene: SceneFile): Promise<void> {
    return this.open({ scene });
  }

  /** Edits the scene; nothing happens where this page only watches. Edits of one `key` in quick succession are one undo step; one that changes nothing is none. */
  edit(patch: Patch, key: string | null = null): void {
    const { sync } = this;
    if (!sync || isWatching(useSession.getState())) return;
    const { fieldError, failure } = useSession.getState();
    if (fieldError && rootOf(fieldError.field) in patch) set({ fieldError: null });
    const before = sync.scene;
    if (!sync.edit(patch)) return;
    this.edits.edited(before, sync.scene, key, performance.now());
    if (failure !== null) set({ failure: null });
    this.publishScene();
    this.inputs.schedule();
  }

  beginGesture(): void {
    if (this.sync) this.edits.beginGesture(this.sync.scene);
  }

  endGesture(): void {
    if (this.sync && this.edits.endGesture(this.sync.scene)) this.publishScene();
  }

  undo(): void {
    this.walk((edits) => edits.undo());
  }

  redo(): void {
    this.walk((edits) => edits.redo());
  }

  moveCamera(camera: Camera): void {
    if (!this.sync) return;
    this.sync.moveCamera(camera);
    this.publishScene();
    this.inputs.moveCamera();
  }

  /** Back to where the scene started. */
  resetView(): void {
    const { startCamera, startFits } = useSession.getState();
    if (startCamera) this.moveCamera(startFits ? this.fitted(startCamera) : startCamera);
  }

  resize(viewport: ViewportSize): void {
    this.inputs.resize(viewport);
  }

  /**
   * A still of what this viewer sees, drawn by the server at the viewport's device pixels. The server
   * draws stills with the session's camera, which watchers do not move: theirs is what is on screen.
   */
  async still(): Promise<Blob> {
    if (isWatching(useSession.getState())) return this.stillOnScreen();
    const { sessionId, scene } = useSession.getState();
    const { viewport } = this.inputs;
    if (!sessionId || !scene?.camera || !viewport || !this.sync) throw new Error("There is no picture yet.");
    // Make the session's camera this viewer's first.
    const camera = { orthographic_height: null, fov_y_degrees: null, ...scene.camera };
    this.sync.tell({ camera });
    this.inputs.schedule();
    await this.settled();
    const { width, height, pixel_ratio } = viewport;
    return rest.getSnapshot(sessionId, Math.round(width * pixel_ratio), Math.round(height * pixel_ratio));
  }

  private stillOnScreen(): Promise<Blob> {
    if (!this.screen || useSession.getState().awaitingPicture) throw new Error("There is no picture yet.");
    return this.screen.still();
  }

  /** Tries to connect at once instead of waiting for the next attempt. */
  retryNow(): void {
    this.connection.retryNow();
  }

  private walk(step: (edits: EditLog) => Patch | null): void {
    const { sync } = this;
    if (!sync || isWatching(useSession.getState())) return;
    this.edits.endGesture(sync.scene);
    const patch = step(this.edits);
    if (!patch) return;
    sync.edit(patch);
    this.publishScene();
    this.inputs.schedule();
  }

  private async refreshStatus(): Promise<void> {
    try {
      set({ status: await rest.getStatus() });
    } catch {
      // The connection's own attempts report that the service is away; asked again on welcome.
    }
  }

  private async followAddress(): Promise<void> {
    const address = parseAddress(window.location.hash);
    if (address.kind === "session") {
      if (address.id !== useSession.getState().sessionId) this.attach(address.id);
      return;
    }
    if (address.kind === "scene") {
      try {
        await this.openScene(await decodeScene(address.code));
        return;
      } catch (error) {
        set({ failure: wordsOf(error) });
      }
    }
    if (!this.sync) await this.openFirstDataset();
  }

  private async openFirstDataset(): Promise<void> {
    const wish = this.begin();
    try {
      const [first] = await rest.getDatasets();
      if (wish !== this.wish) return;
      if (first) await this.create({ dataset: first.id }, wish);
      else set({ link: "failed", failure: "There is no dataset yet. Drop a volume file anywhere on the page." });
    } catch (error) {
      if (wish === this.wish) this.openLater(error, () => void this.openFirstDataset());
    }
  }

  /** Opens a new session; the old one stays until the new one is there. */
  private async open(request: CreateSession): Promise<void> {
    const { sessionId, link } = useSession.getState();
    const wish = this.begin();
    try {
      await this.create(request, wish);
    } catch (error) {
      if (wish === this.wish) set(sessionId ? { link } : { link: "failed", failure: wordsOf(error) });
      throw error;
    }
  }

  private async create(request: CreateSession, wish: number): Promise<void> {
    const { sessionId } = useSession.getState();
    const session = await rest.createSession(request);
    rememberSession(session);
    if (wish !== this.wish) return;
    this.adopt(session.id, session.scene);
    set({ startFits: request.dataset !== undefined });
    window.history[sessionId ? "pushState" : "replaceState"](null, "", sessionAddress(session.id));
    this.connection.connect(session.id);
  }

  private attach(id: string): void {
    this.begin();
    this.adopt(id, null);
    void this.connection.find(id);
  }

  private begin(): number {
    this.wish += 1;
    this.rememberView();
    const { link } = useSession.getState();
    // While the service is away its reason stays on screen until an attempt works.
    if (link !== "lost") set({ link: link === "open" ? "open" : "connecting", failure: null });
    return this.wish;
  }

  private adopt(id: string, scene: SceneFile | null): void {
    this.connection.close();
    this.connection.succeeded();
    this.forgetConnection();
    this.sync = scene ? new SceneSync(scene) : null;
    this.edits = new EditLog();
    this.volume.forget();
    set({
      sessionId: id, role: "editor", link: "connecting", retryAt: null, startCamera: null, startFits: false, report: null, changeReport: null, pictureReport: null, staleShares: null, compressionError: null, editWork: null,
      awaitingPicture: true, progress: null, notice: null, settled: false, failure: null, fieldError: null, canUndo: false, canRedo: false,
      scene: scene ?? useSession.getState().scene,
    });
  }

  private forgetConnection(): void {
    this.receiver?.close();
    this.receiver = null;
    this.welcomed = false;
    this.meters.disconnected();
    this.editMeter.forget();
    this.lightMeter.forget();
  }

  /** The session is gone: opens one like it from the scene on screen. */
  private async recreate(): Promise<void> {
    const { wish } = this;
    const scene = this.sync?.scene;
    if (!scene) {
      await this.openFirstDataset();
      if (useSession.getState().sessionId) set({ notice: SESSION_EXPIRED });
      return;
    }
    try {
      const session = await rest.createSession({ scene });
      rememberSession(session);
      if (wish !== this.wish) return;
      this.sync?.reattach(session.scene);
      window.history.replaceState(null, "", sessionAddress(session.id));
      const watched = isWatching(useSession.getState());
      set({ sessionId: session.id, role: session.role, ...(watched ? { notice: WATCHED_ENDED } : {}) });
      this.connection.connect(session.id);
    } catch (error) {
      if (wish === this.wish) this.openLater(error, () => void this.recreate());
    }
  }

  /** Opening did not work: again later where the service is away or full, else say why. */
  private openLater(error: unknown, again: () => void): void {
    const refused = error instanceof rest.ProblemError && error.status !== rest.UNREACHABLE && error.status < 500;
    set({ link: refused ? "failed" : "lost", failure: wordsOf(error) });
    if (!refused) this.connection.retry(again);
  }

  private takeMessage(message: ServerMessage): void {
    switch (message.type) {
      case "welcome":
        this.welcome(message);
        break;
      case "scene":
        this.sync?.receive(message.seq, message.scene);
        this.volume.scene(message.scene.volume, message.shown);
        // Another volume has other bins.
        if (!deepEqual(message.scene.volume, useSession.getState().scene?.volume)) set({ staleShares: null });
        set({ methodSince: sinceEpoch(useSession.getState().methodSince, message.scene.illumination.method, message.epoch) });
        this.publishScene();
        break;
      case "rejected":
        this.rejected(message.seq, message.field, message.message);
        break;
      case "report":
        set(reported(message.report));
        this.editMeter.reported(message.frame, message.report);
        set({ editWork: this.editMeter.read() });
        break;
      case "progress":
        set({ progress: message.fraction >= 1 ? null : { activity: message.activity, fraction: message.fraction } });
        break;
      case "failed":
        set({ failure: message.message, progress: null });
        break;
      case "closing":
        set({ failure: `The service closed the connection: ${message.reason}.` });
        break;
    }
    if (this.sync?.settled) this.settleWaiters.splice(0).forEach((done) => done());
  }

  private welcome(message: Extract<ServerMessage, { type: "welcome" }>): void {
    if (message.protocol !== PROTOCOL_VERSION) {
      this.refuseProtocol();
      return;
    }
    this.welcomed = true;
    this.connection.succeeded();
    const { startCamera, startFits } = useSession.getState();
    if (this.sync) this.sync.reattach(message.scene);
    else this.sync = new SceneSync(message.scene);
    this.cameras = message.scene.camera ? new CameraTrail(message.scene.camera) : null;
    this.volume.greeted(message.scene.volume, message.dataset, message.shown);
    // Epochs of another session are other numbers.
    set({ methodSince: { method: message.scene.illumination.method, epoch: message.epoch } });
    set({ link: "open", role: message.role, failure: null, retryAt: null, device: message.device });
    if (!startCamera && message.scene.camera) this.startAt(message.session, message.scene.camera, startFits);
    if (!useSession.getState().status) void this.refreshStatus();
    if (document.hidden) this.connection.send({ type: "visible", visible: false });
    this.publishScene();
    this.inputs.repeat();
  }

  /** The first greeting of a session: where its view starts, or where this page was before a reload. */
  private startAt(session: string, camera: Camera, fits: boolean): void {
    const remembered = loadView(session);
    set({ startCamera: remembered?.start ?? camera, startFits: remembered?.startFits ?? fits });
    if (remembered) this.sync?.moveCamera(remembered.camera);
    else if (fits) this.sync?.moveCamera(this.fitted(camera));
  }

  private fitted(camera: Camera): Camera {
    const { viewport } = this.inputs;
    return viewport ? forAspect(camera, viewport.width / viewport.height) : camera;
  }

  private refuseProtocol(): void {
    this.connection.close();
    set({ link: "failed", failure: "The service speaks another version of the protocol. Reload the page." });
  }

  private rejected(seq: number, field: string, message: string): void {
    const refused = this.cameras?.refused(seq);
    if (refused && deepEqual(refused.camera, this.sync?.scene.camera)) this.sync?.moveCamera(refused.before);
    if (this.sync?.reject(seq)) this.edits.refused(rootOf(field));
    set({ fieldError: { field, message } });
    this.publishScene();
  }

  private takeFrame(buffer: ArrayBuffer): void {
    this.meters.frameArrived(buffer.byteLength, performance.now());
    const header = decodeFrameHeader(buffer);
    if (header) this.editMeter.arrived(header);
    this.receiver ??= new FrameReceiver<ImageBitmap>({
      decode: (payload) => createImageBitmap(payload, { colorSpaceConversion: "none" }),
      show: (picture, header) => this.showFrame(picture, header),
      acknowledge: (frame, decode_millis) => this.connection.send({ type: "ack", frame, decode_millis }),
      damaged: (failure) => set({ failure }),
      now: () => performance.now(),
    });
    this.receiver.receive(buffer);
  }

  private showFrame(picture: ImageBitmap, header: FrameHeader): void {
    this.screen?.show(picture, header);
    this.meters.frameShown(header.seq, performance.now());
    this.editMeter.shown(header, performance.now());
    if (isInOwnLight({ ...useSession.getState(), frame: header })) this.lightMeter.shown(header, performance.now());
    else this.lightMeter.forget();
    this.cameras?.shown(header.seq);
    set({ frame: header, awaitingPicture: false, progress: null, editWork: this.editMeter.read(), lightMillis: this.lightMeter.read() });
  }

  private numbered(seq: number): void {
    this.meters.inputSent(seq, performance.now());
    if (useSession.getState().atRest) set({ atRest: false });
    window.clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => set({ atRest: true }), REST_MILLIS);
  }

  private settled(): Promise<void> {
    return new Promise((resolve) => {
      this.settleWaiters.push(resolve);
      window.setTimeout(resolve, SETTLE_MILLIS);
    });
  }

  private publishScene(): void {
    if (this.sync) set({ scene: this.sync.scene, settled: this.sync.settled, canUndo: this.edits.canUndo, canRedo: this.edits.canRedo });
  }

  private publishReadings(): void {
    const readings = this.meters.read(performance.now());
    const shown = useSession.getState().readings;
    const same = (Object.keys(readings) as (keyof typeof readings)[]).every((key) => readings[key] === shown[key]);
    if (!same) set({ readings });
  }

  private rememberView(): void {
    const { sessionId, scene, startCamera, startFits } = useSession.getState();
    if (sessionId && this.sync && scene?.camera && startCamera) saveView(sessionId, { camera: scene.camera, start: startCamera, startFits });
  }
}

/** The page's session. */
export const session = new Engine();
