// The epoch a page shows: the one in the address, else the last before the replay's instant, else the latest.
import { route } from "../../lib/route.svelte";
import type { EpochSummary } from "../../lib/state";
import { resource, type Resource } from "./resource.svelte";

export interface Epochs { epochs: EpochSummary[] }

export class ChosenEpoch {
  readonly list: Resource<Epochs>;
  private readonly key: string;
  /** Epoch held by the address that is older than the list. */
  private readonly older: Resource<EpochSummary>;

  constructor(key: string) {
    this.key = key;
    this.list = resource<Epochs>(() => ["/api/epochs", { until: route.at, limit: 60 }], { on: ["epoch"] });
    this.older = resource<EpochSummary>(() => (this.held && this.list.value && !this.all.some((e) => e.number === this.number) ? [`/api/epochs/${this.number}`] : null));
  }

  all = $derived.by(() => [...(this.list.value?.epochs ?? [])].sort((a, b) => a.number - b.number));
  latest = $derived.by(() => this.all.at(-1)?.number ?? null);
  /** True where the address names the epoch, so that the page stays with it. */
  held = $derived.by(() => route.query[this.key] !== undefined && Number.isInteger(Number(route.query[this.key])));
  number = $derived.by(() => (this.held ? Number(route.query[this.key]) : this.latest));
  summary = $derived.by(() => this.all.find((e) => e.number === this.number) ?? (this.older.value?.number === this.number ? this.older.value : null));
}

export const chosenEpoch = (key = "epoch"): ChosenEpoch => new ChosenEpoch(key);
