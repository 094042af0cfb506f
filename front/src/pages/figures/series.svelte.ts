// Series on the page: fetched whole for a stretch of time, then only what is new where the stretch ends now.
import { untrack } from "svelte";
import { ApiError, get } from "../../lib/api";
import { live } from "../../lib/live.svelte";
import { route } from "../../lib/route.svelte";
import type { Series } from "../answers";
import { appended } from "./strips";

const MOST = 2000; // values a series, as many as a strip has pixels
const PAUSE_S = 2;
const OVERLAP_S = 180; // epochs are solved after the instant they stand for
const WHOLE_EVERY = 30; // rounds: the last bins of a binned series do not stay fine for ever

/** The last days before now or before the replay's instant, or a fixed span. */
export type Stretch = { days: number } | { since: number; until: number };

export const present = (): number => route.at ?? live.now();
export const spanOf = (stretch: Stretch): [number, number] => ("days" in stretch ? [present() - stretch.days, present()] : [stretch.since, stretch.until]);

export class FollowedSeries {
  value = $state.raw<Series | null>(null);
  error = $state<string | null>(null);
  loading = $state(false);

  /** To be called while a component is set up. */
  constructor(names: () => string[], stretch: () => Stretch) {
    const wanted = $derived(JSON.stringify([names(), stretch(), "days" in stretch() ? route.at : null]));
    $effect(() => {
      const [list, over] = JSON.parse(wanted) as [string[], Stretch];
      return untrack(() => this.follow(list, over));
    });
  }

  private follow(names: string[], stretch: Stretch): (() => void) | void {
    if (!names.length) return void (this.value = null);
    const stop = new AbortController(), grows = "days" in stretch && route.at === null;
    let timer = 0, round = 0, reached = 0;
    const load = async (whole: boolean): Promise<void> => {
      const [since, until] = spanOf(stretch), from = whole ? since : Math.max(since, reached - OVERLAP_S / 86400);
      try {
        const answer = await get<Series>("/api/series", { names: names.join(","), since: from, until: grows ? null : until, most: MOST }, stop.signal);
        this.value = whole || !this.value ? answer : appended(this.value, answer, since);
        this.error = null;
        reached = until;
      } catch (error) {
        if (stop.signal.aborted) return;
        this.error = error instanceof Error ? error.message : String(error);
        if (error instanceof ApiError && (error.status === 404 || error.status === 422)) this.value = null;
      }
      if (stop.signal.aborted) return;
      this.loading = false;
      round += 1;
      const binned = this.value?.names.some((s) => s.low) ?? false;
      if (grows || this.error) timer = window.setTimeout(() => void load(!this.value || (binned && round % WHOLE_EVERY === 0)), PAUSE_S * 1000);
    };
    this.loading = true;
    void load(true);
    return () => {
      stop.abort();
      clearTimeout(timer);
    };
  }
}
