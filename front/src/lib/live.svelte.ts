// The live link: one WebSocket for the whole page. It opens by itself, again after a loss, and says who is silent.
import { silentPart } from "./silence";
import type { State } from "./state";
import { mjdNow } from "./time";
import { token } from "./token.svelte";

export type Kind = "state" | "shot" | "epoch" | "event" | "posture" | "weather" | "lag";
type Handler = (data: unknown) => void;

const KINDS: Kind[] = ["state", "shot", "epoch", "event", "posture", "weather"];
const TICK_MS = 150;
const DEAF_S = 8; // after so long without a word the socket may be dead without saying so: it is opened anew
const BACKOFF_S = [0.25, 0.5, 1, 2]; // the last one again and again

class Live {
  link = $state<"connecting" | "open" | "lost">("connecting");
  state = $state.raw<State | null>(null);
  /** Milliseconds of performance.now() at the last "state". */
  receivedAt = $state(0);
  /** What the service said when it closed the link; null: nothing. */
  refusal = $state<string | null>(null);
  dropped = $state(0);
  private tick = $state(performance.now());
  private heardAt = $state(0); // when the coordinator last spoke, as far as this page knows
  private base = $state.raw<{ mjd: number; at: number } | null>(null); // the site's time at an instant of this page
  private handlers = new Map<Kind, Set<Handler>>();
  private socket: WebSocket | null = null;
  private tries = 0;
  private timer = 0;
  private openedAt = 0;
  private started = false;
  private startedAt = $state(0); // 0: not started, or ended

  /** Seconds since the last "state", or since the start before the first. */
  silence = $derived(Math.max(0, this.tick - (this.state ? this.receivedAt : this.startedAt)) / 1000);
  /** Seconds since the coordinator last spoke to the service: another answer, or anything that it pushed. */
  coordinatorSilence = $derived(Math.max(0, this.tick - this.heardAt) / 1000);
  /** Which part is silent, or null where all speak. */
  silent = $derived.by((): "service" | "coordinator" | null => {
    if (!this.startedAt) return null;
    return silentPart({
      lost: this.link === "lost", service: this.silence, coordinator: this.coordinatorSilence,
      connected: this.state?.connected ?? null, watched: this.state?.source === "live",
    });
  });
  stale = $derived(this.silent !== null || !this.state);
  /** MJD of the last word of the silent part. */
  since = $derived(this.state ? (this.state.received ?? this.state.mjd) : null);

  /** The site's UTC now, MJD. */
  now(): number {
    return this.base ? this.base.mjd + Math.max(0, this.tick - this.base.at) / 86_400_000 : mjdNow() + 0 * this.tick;
  }

  /** Age in seconds of a value of an instant (MJD), by the site's clock. */
  age(mjd: number): number {
    return (this.now() - mjd) * 86400;
  }

  /** Call `handler` with the data of each message of a kind; the answer ends that. */
  on(kind: Kind, handler: Handler): () => void {
    const set = this.handlers.get(kind) ?? new Set<Handler>();
    this.handlers.set(kind, set);
    set.add(handler);
    return () => set.delete(handler);
  }

  start(): void {
    if (this.started) return;
    this.started = true;
    this.startedAt = performance.now();
    setInterval(() => this.ticked(), TICK_MS);
    const wake = (): void => {
      this.tick = performance.now();
      if (this.link === "lost") this.again(0);
    };
    addEventListener("online", wake);
    document.addEventListener("visibilitychange", () => document.visibilityState === "visible" && wake());
    this.open();
  }

  /** End the link: a finished result has nothing live. */
  stop(): void {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    old?.close();
    this.startedAt = 0;
  }

  /** Open the link anew: after another token. */
  restart(): void {
    this.tries = 0;
    this.again(0);
  }

  private ticked(): void {
    this.tick = performance.now();
    if (this.socket === null || this.tick - Math.max(this.receivedAt, this.openedAt) < 1000 * DEAF_S) return;
    this.link = "lost";
    this.again(0);
  }

  private open(): void {
    this.openedAt = performance.now();
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/api/live`);
    this.socket = socket;
    socket.onopen = () => {
      socket.send(JSON.stringify({ token: token.text, kinds: KINDS }));
    };
    socket.onmessage = (event: MessageEvent) => this.read(event.data);
    socket.onclose = (event: CloseEvent) => {
      if (this.socket !== socket) return;
      this.refusal = event.reason || null;
      this.link = "lost";
      this.again(BACKOFF_S[Math.min(this.tries, BACKOFF_S.length - 1)] ?? 2);
      this.tries += 1;
    };
  }

  private again(seconds: number): void {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    old?.close();
    this.timer = window.setTimeout(() => this.open(), seconds * 1000 * (0.8 + 0.4 * Math.random()));
  }

  private read(text: unknown): void {
    if (typeof text !== "string") return;
    let message: { kind?: Kind; data?: unknown };
    try {
      message = JSON.parse(text);
    } catch {
      return; // not ours; the silence says the rest
    }
    if (!message.kind) return;
    if (message.kind === "state") this.take(message.data as State);
    else if (message.kind === "lag")
      for (const n of Object.values((message.data as { dropped?: Record<string, number> }).dropped ?? {})) this.dropped += n;
    else this.heardAt = performance.now(); // whatever the coordinator pushes shows that it lives
    for (const handler of this.handlers.get(message.kind) ?? []) handler(message.data);
  }

  private take(state: State): void {
    const now = performance.now();
    if (state.received !== this.state?.received) {
      this.heardAt = now;
      this.base = state.mjd == null ? null : { mjd: state.mjd, at: now };
    }
    this.state = state;
    this.receivedAt = now;
    this.tick = now;
    this.link = "open";
    this.refusal = null;
    this.tries = 0;
  }
}

export const live = new Live();
