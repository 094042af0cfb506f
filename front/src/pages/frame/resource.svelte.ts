// An answer of the service that renews itself: when its address changes, and when live messages of its kinds come.
import { untrack } from "svelte";
import { ApiError, get, type Query } from "../../lib/api";
import { live, type Kind } from "../../lib/live.svelte";
import { route } from "../../lib/route.svelte";

const AGAIN_S = 3; // after a service that did not answer
const PATIENCE_S = 2; // for an answer that is no longer wanted: a slider that moves shall still show something

export type Request = readonly [path: string, query?: Query] | null;
export interface Renewal {
  on?: Kind[]; // live messages after which it is fetched again, not during a replay
  pause?: number; // least seconds between two fetches for that reason
}

export class Resource<T> {
  /** Last good answer; it stays while the next one is on its way. */
  value = $state.raw<T | null>(null);
  error = $state<string | null>(null);
  /** HTTP status of the error: 404 is no data; 0, the service did not answer. */
  status = $state(0);
  loading = $state(false);
  private wanted: Request = null;
  private flight: AbortController | null = null;
  private timer = 0;
  private startedAt = 0;

  want(request: Request): void {
    this.wanted = request;
    clearTimeout(this.timer);
    if (request === null) return this.clear();
    if (!this.flight) return void this.fetch(request);
    const old = this.flight;
    this.timer = window.setTimeout(() => old.abort(), PATIENCE_S * 1000);
  }

  /** Fetch again, not sooner than `pause` seconds after the last start. */
  renew(pause: number): void {
    if (this.flight || this.wanted === null) return;
    const left = pause * 1000 - (performance.now() - this.startedAt);
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.wanted && !this.flight && void this.fetch(this.wanted), Math.max(0, left));
  }

  clear(): void {
    clearTimeout(this.timer);
    this.wanted = null;
    this.flight?.abort();
    this.flight = null;
    this.value = null;
    this.error = null;
    this.loading = false;
  }

  private async fetch(request: NonNullable<Request>): Promise<void> {
    const flight = new AbortController();
    this.flight = flight;
    this.startedAt = performance.now();
    this.loading = true;
    try {
      const value = await get<T>(request[0], request[1], flight.signal);
      if (this.flight !== flight) return;
      this.value = value;
      this.error = null;
    } catch (error) {
      if (this.flight !== flight) return;
      if (!flight.signal.aborted) this.refused(error);
    }
    this.flight = null;
    this.loading = false;
    if (this.wanted !== request && this.wanted !== null) this.want(this.wanted);
    else if (this.error !== null && this.status !== 404 && this.status !== 422) this.renew(AGAIN_S);
  }

  private refused(error: unknown): void {
    this.error = error instanceof Error ? error.message : String(error);
    this.status = error instanceof ApiError ? error.status : 0;
    if (this.status === 404 || this.status === 422) this.value = null;
  }
}

/** Resource of a path and query; null asks for nothing. To be called while a component is set up. */
export function resource<T>(request: () => Request, renewal: Renewal = {}): Resource<T> {
  const own = new Resource<T>();
  const wanted = $derived(JSON.stringify(request()));
  const follows = $derived(route.at === null);
  $effect(() => {
    const next = JSON.parse(wanted) as Request;
    untrack(() => own.want(next));
  });
  $effect(() => {
    if (!follows) return;
    const ends = (renewal.on ?? []).map((kind) => live.on(kind, () => own.renew(renewal.pause ?? 2)));
    return () => ends.forEach((end) => end());
  });
  $effect(() => () => own.clear());
  return own;
}
