"""Many units of work: processes of this machine or a cluster, a ledger, and where a run goes on."""
