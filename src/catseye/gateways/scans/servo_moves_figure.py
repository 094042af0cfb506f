"""Figure of an identified servo: moves, their acceleration by measurement and model, residuals."""

from catseye.gateways.writers.drawing import FAINT, SERIES, Figure, styled
from catseye.reduction.steering.servo_identification import ServoFit


def servo_moves_figure(fit: ServoFit) -> Figure:
    """Position, mean acceleration of each window and what is left of it, by time."""
    with styled():
        figure = Figure(figsize=(7.2, 6.2), layout="constrained")
        position, acceleration, residual = figure.subplots(3, 1, sharex=True, height_ratios=(2, 2, 1))
        for move in fit.moves:
            position.plot(move.time, move.position, color=SERIES[0], lw=1.4)
        acceleration.plot(fit.centre, 1e-3 * fit.measured, "o", ms=5.0, color=SERIES[0], label="measured")
        acceleration.plot(
            fit.centre, 1e-3 * fit.predicted, "x", ms=5.0, mew=1.2, color=SERIES[1], label="by drive and axis"
        )
        residual.set_title("Residuals, and their scatter")
        residual.axhspan(-1e-3 * fit.scatter, 1e-3 * fit.scatter, color=FAINT, alpha=0.25, lw=0)
        residual.axhline(0.0, color=FAINT, lw=0.8)
        residual.plot(fit.centre, 1e-3 * fit.residual, "o", ms=4.0, color=SERIES[0])
        position.set_title(f"{len(fit.moves)} moves, {len(fit.measured)} windows")
        position.set_ylabel("position (counts)")
        acceleration.set_ylabel("acceleration (1000 counts/s²)")
        residual.set_ylabel("(1000 counts/s²)")
        residual.set_xlabel("time (s)")
        acceleration.legend(loc="best")
        return figure
