/** Few at a time: what may wait does not take the connections from what may not. */

interface Waiting {
  start: () => void;
  state: "waiting" | "started" | "over";
}

export class Turns {
  private readonly queue: Waiting[] = [];
  private running = 0;

  constructor(private readonly limit: number) {}

  /** Calls `start` when there is a turn, at once or later. The returned function ends the turn, or the wait for it. */
  ask(start: () => void): () => void {
    const entry: Waiting = { start, state: "waiting" };
    this.queue.push(entry);
    this.next();
    return () => {
      if (entry.state === "started") this.running -= 1;
      entry.state = "over";
      this.next();
    };
  }

  private next(): void {
    while (this.running < this.limit) {
      const entry = this.queue.shift();
      if (!entry) return;
      if (entry.state !== "waiting") continue;
      entry.state = "started";
      this.running += 1;
      entry.start();
    }
  }
}
