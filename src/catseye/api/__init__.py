"""Functions of `import catseye`, one a job: arrays and paths in, frozen results out.

Each function takes a path, a bundled name or what `load` gave, and answers with a `Result` (`result`). A subject is a
file: `reading` (load, examples), `night` (reduce, explain), `weather` (air, sound), `living` (simulate, replay).
Nothing heavier than numpy is imported before a function is called; `catseye` itself says which file has which name.
"""
