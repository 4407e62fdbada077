/** The WebSocket to a session: opens it, keeps trying while it is away, tells when the session is gone. */

import { getSession, ProblemError, viewUrl } from "../api/rest";
import { rememberSession } from "./ownSessions";
import { PROTOCOL_VERSION, type ClientMessage, type ServerMessage } from "../generated/proto";

/** Pauses between attempts, milliseconds; the last repeats. */
export const RETRY_MILLIS = [300, 700, 1500, 3000, 6000, 10_000] as const;
/** Close codes of the service: the session does not exist; the greeting is not of its protocol. */
const CLOSE_SESSION_GONE = 4404;
const CLOSE_BAD_HELLO = 4400;

/** What the connection tells. */
export interface ConnectionEvents {
  message: (message: ServerMessage) => void;
  picture: (buffer: ArrayBuffer) => void;
  /** The connection broke or could not be made; the next attempt is under way. */
  lost: () => void;
  /** The session does not exist (any more). */
  gone: () => void;
  /** The other side speaks another protocol; trying again is of no use. */
  foreign: () => void;
  /** The next attempt starts at this time (milliseconds since 1970); null: now. */
  waiting: (until: number | null) => void;
}

export class Connection {
  private socket: WebSocket | null = null;
  private timer: number | undefined;
  private attempt = 0;
  private again: (() => void) | null = null;
  /** The viewer this page is, by session: said again after a loss, its picture is still there. */
  private viewer: { session: string; resume: string } | null = null;
  /** Grows with every session; answers that concern an older one are dropped. */
  private generation = 0;

  constructor(private readonly events: ConnectionEvents) {}

  /** Connects to a session that is known to exist. */
  connect(id: string): void {
    this.close();
    const { generation } = this;
    const socket = new WebSocket(viewUrl(id));
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    const resume = this.viewer?.session === id ? this.viewer.resume : undefined;
    socket.onopen = () => this.send({ type: "hello", protocol: PROTOCOL_VERSION, ...(resume && { resume }) });
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (generation !== this.generation) return;
      if (typeof event.data === "string") {
        const message = JSON.parse(event.data) as ServerMessage;
        if (message.type === "welcome") this.viewer = { session: id, resume: message.resume };
        this.events.message(message);
      } else this.events.picture(event.data);
    };
    socket.onclose = (event) => {
      if (generation !== this.generation) return;
      this.socket = null;
      this.events.lost();
      if (event.code === CLOSE_SESSION_GONE) this.events.gone();
      else if (event.code === CLOSE_BAD_HELLO) this.events.foreign();
      else this.retry(() => void this.find(id));
    };
  }

  /** Asks whether a session exists, then connects: a socket that fails to open does not say why. */
  async find(id: string): Promise<void> {
    this.close();
    const { generation } = this;
    try {
      rememberSession(await getSession(id));
      if (generation === this.generation) this.connect(id);
    } catch (error) {
      if (generation !== this.generation) return;
      this.events.lost();
      if (error instanceof ProblemError && error.status === 404) this.events.gone();
      else this.retry(() => void this.find(id));
    }
  }

  /** Runs `again` after a pause that grows with every attempt that fails. */
  retry(again: () => void): void {
    this.stopWaiting();
    const pause = RETRY_MILLIS[Math.min(this.attempt, RETRY_MILLIS.length - 1)] ?? 0;
    this.attempt += 1;
    this.again = again;
    this.timer = window.setTimeout(() => this.retryNow(), pause);
    this.events.waiting(Date.now() + pause);
  }

  /** Starts a waiting attempt at once. */
  retryNow(): void {
    const { again } = this;
    this.stopWaiting();
    if (!again) return;
    this.events.waiting(null);
    again();
  }

  /** The other side has answered: the next loss starts with the shortest pause. */
  succeeded(): void {
    this.attempt = 0;
  }

  send(message: ClientMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  /** Lets go of the session; nothing more is heard of it. */
  close(): void {
    this.generation += 1;
    this.stopWaiting();
    this.socket?.close();
    this.socket = null;
  }

  private stopWaiting(): void {
    window.clearTimeout(this.timer);
    this.again = null;
  }
}
