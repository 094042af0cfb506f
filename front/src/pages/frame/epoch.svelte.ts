// The epoch a page shows: the one in the address, else the last before the replay's instant, else the latest. Numbers
// begin again with each run of the coordinator: an epoch is of the run in the address, else of the latest.
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
    this.older = resource<EpochSummary>(() => (this.held && this.list.value && !this.all.some((e) => e.number === this.number) ? [`/api/epochs/${this.number}`, this.query] : null));
  }

  /** Run of the journal; null without a journal. */
  run = $derived.by(() => (route.query.run !== undefined ? Number(route.query.run) : (this.list.value?.epochs.at(-1)?.run ?? null)));
  /** The run, for the requests of this epoch. */
  query = $derived.by((): { run?: number } => (this.run === null ? {} : { run: this.run }));
  all = $derived.by(() => (this.list.value?.epochs ?? []).filter((e) => this.run === null || e.run === this.run).sort((a, b) => a.number - b.number));
  latest = $derived.by(() => this.all.at(-1)?.number ?? null);
  /** True where the address names the epoch, so that the page stays with it. */
  held = $derived.by(() => route.query[this.key] !== undefined && Number.isInteger(Number(route.query[this.key])));
  number = $derived.by(() => (this.held ? Number(route.query[this.key]) : this.latest));
  summary = $derived.by(() => this.all.find((e) => e.number === this.number) ?? (this.older.value?.number === this.number ? this.older.value : null));
}

export const chosenEpoch = (key = "epoch"): ChosenEpoch => new ChosenEpoch(key);
