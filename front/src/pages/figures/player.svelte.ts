// The replay's clock: it moves `at` of the address, at a speed, between two ends.
import { route, set } from "../../lib/route.svelte";

const TICK_MS = 250;
export const SPEEDS = [1, 2, 5, 10, 20, 50, 100];

export class Player {
  playing = $state(false);
  private readonly ends: () => [number, number];

  /** To be called while a component is set up. */
  constructor(ends: () => [number, number]) {
    this.ends = ends;
    $effect(() => {
      if (!this.playing) return;
      let before = performance.now();
      const timer = setInterval(() => {
        const now = performance.now();
        this.move((now - before) / 1000 * this.speed);
        before = now;
        if ((route.at ?? 0) >= this.ends()[1]) this.playing = false;
      }, TICK_MS);
      return () => clearInterval(timer);
    });
  }

  speed = $derived(SPEEDS.includes(Number(route.query.speed)) ? Number(route.query.speed) : 10);

  /** To an instant within the ends, MJD. */
  to(mjd: number): void {
    const [since, until] = this.ends();
    set({ at: Math.min(until, Math.max(since, mjd)).toFixed(7) });
  }

  move(seconds: number): void {
    this.to((route.at ?? this.ends()[1]) + seconds / 86400);
  }

  toggle(): void {
    if (!this.playing && (route.at === null || route.at >= this.ends()[1])) this.to(this.ends()[0]);
    this.playing = !this.playing;
  }

  live(): void {
    this.playing = false;
    set({ at: null });
  }
}
