"""`Retrainer`: readings in, corrected readings out, and what corrects them kept up to date."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.calibration.retraining import (
    RetrainerParams,
    RetrainerState,
    Retraining,
    Running,
    Why,
    Window,
)
from agonic.errors import AgonicError
from agonic.health import Finding, Judged, figure, sentences
from agonic.maths.estimation.changes import cusum
from agonic.network.fit.problem import compute_errors
from agonic.network.retraining import acceptance, candidates, schedule
from agonic.network.retraining.acceptance import Judgement, Unseen
from agonic.network.retraining.evidence import list_findings
from agonic.network.retraining.files import load_retrainer, save_retrainer
from agonic.network.retraining.posterior import describe_prior
from agonic.reference import Reference
from agonic.samples import Samples


def split_off(rows: Window) -> tuple[Window, Window]:
    """Rows to train on, and the third that comes next."""
    cut = len(rows) - len(rows) // 3
    return rows.select(slice(0, cut)), rows.select(slice(cut, None))


@dataclass(frozen=True, kw_only=True, eq=False)
class Correction:
    """What an update gave: readings corrected by what was running when each of them came.

    `time` (n,) s, `field` (n, 3) nT, and `residual` (n, 3), or (n, 1) of the magnitude, nT, are of
    the readings that were used, NaN while nothing was running; `retrainings` those that took place.
    """

    time: Array
    field: Array
    residual: Array
    retrainings: tuple[Retraining, ...]


class Retrainer(Judged):
    """A network that is trained again on the last readings, periodically and after a change.

    Holds the settings and the state; `update` moves the state on. A candidate, which starts from
    the running weights, replaces what is running only where it is clearly better on readings of the
    window that it was not trained on.

    Parameters
    ----------
    calibration : what corrects at the start: a `Network`, an `Affine` or `Thermal` to put one on,
        or None.
    params : how it is kept up to date.

    Source: Wang, Sheng, He & Cheng (2020), section 4, doi:10.4236/jcc.2020.86004; changes by Page's
    (1954) cumulative sums, doi:10.1093/biomet/41.1-2.100.

    Examples
    --------
    >>> from agonic.network.fit import fit_network
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(30.0)  # the sensor changes at 15 s
    >>> ground = made.select(made.samples.time < 15.0)
    >>> fit = fit_network(ground.samples, ground.reference, base=None, compared=False)
    >>> retrainer = Retrainer(fit.calibration, RetrainerParams(window_s=15.0))
    >>> seen = retrainer.update(made.samples, made.reference)
    >>> [(one.why, one.accepted) for one in seen.retrainings if one.onset is not None]
    [('change', True)]
    """

    def __init__(
        self, calibration: Running | None = None, params: RetrainerParams | None = None
    ) -> None:
        self.params = candidates.adapt(params or RetrainerParams(), calibration)
        self.state: RetrainerState = schedule.start(calibration, self.params)

    def update(self, samples: Samples, reference: Reference) -> Correction:
        """Move on by the readings of a log or of a moment; one or many come to the same.

        Parameters: samples with times later than all before, in the unit and axes of the
        calibration, with the columns that the network takes; reference, the field at each, in axes
        m or b, or n with the attitude in the samples, or its magnitude where that is the target.
        Rows that are flagged are passed over.

        Returns the readings corrected, and the retrainings.

        Raises `LogError` without times or columns, `UnitError` and `FrameError` where samples and
        reference do not meet the calibration, `AgonicError` where they are not later.
        """
        state, rows = candidates.take_samples(self.state, self.params, samples, reference)
        if state.n == 0 and len(rows):
            fresh_state = replace(state, epoch=samples.epoch)
            state = schedule.begin(fresh_state, self.params, float(rows.time[0]))
        self.state, done = state, 0
        seen: list[tuple[Array, Array]] = []
        fresh: list[Retraining] = []
        while done < len(rows):
            due = schedule.find_due(self.state, self.params, rows.time[done:])
            stop = len(rows) if due is None else done + due.row + 1
            piece = rows.select(slice(done, stop))
            field = candidates.correct(self.state.running, piece)
            residual = compute_errors(field, piece.wanted)
            taken, alarmed = self._take(piece, residual)
            seen.append((field[:taken], residual[:taken]))
            done += taken
            if due is not None and done == stop and not alarmed:
                fresh += self._run_due(due.why)
        fields, residuals = zip(*seen, strict=True) if seen else ((rows.raw,), (rows.wanted,))
        return Correction(
            time=rows.time,
            field=np.concatenate(fields),
            residual=np.concatenate(residuals),
            retrainings=tuple(fresh),
        )

    def _take(self, piece: Window, residual: Array) -> tuple[int, bool]:
        """Rows into the window, up to the first at which the residual is seen to have changed."""
        state, params = self.state, self.params
        # not before anything runs, nor while a change is being learned
        learning = state.onset is not None or state.settling is not None or state.early
        if state.noise is None or state.running is None or learning:
            self.state = schedule.take_rows(state, params, piece)
            return len(piece), False
        seen = cusum.advance(
            state.watch,
            residual / state.noise,
            drift=params.shift_sd / 2,
            alarm=params.alarm,
            correlation=state.correlation,
        )
        state = replace(state, watch=seen.sums)
        state = schedule.take_rows(state, params, piece.select(slice(0, seen.rows)))
        if not seen.alarmed:
            self.state = state
            return seen.rows, False
        onset = max(state.n - seen.age, state.first)
        if not state.retrainings:  # from then on the correlation is that of unseen readings
            before = onset - state.first
            rows = state.window.select(slice(0, before if before >= schedule.TELLING else None))
            left = compute_errors(candidates.correct(state.running, rows), rows.wanted)
            state = schedule.discount_alarm(state, acceptance.estimate_noise(left)[1])
        self.state = state
        alarmed = bool((state.watch.size > params.alarm).any())
        if alarmed:
            self.state = replace(state, onset=onset)
        return seen.rows, alarmed

    def _run_due(self, why: Why) -> list[Retraining]:
        """The retraining that is due, unless an alarm turns out too faint for one."""
        state, first = self.state, max(self.state.learned - self.state.first, 0)
        if state.onset is not None:
            rows = state.window.select(slice(state.onset - state.first, None))
            since = compute_errors(candidates.correct(state.running, rows), rows.wanted)
            if acceptance.has_changed(since, state.noise, self.params):
                return [self._retrain(rows, why)]
            # too faint for a change: trained again once the window is full
            self.state = state = replace(state, onset=None, early=True)
            if not schedule.is_full(state, self.params):
                return []
        return [self._retrain(state.window.select(slice(first, None)), why)]

    def _retrain(self, rows: Window, why: Why) -> Retraining:
        """Train candidates on rows, and put the best in place if it is clearly better."""
        state = self.state
        verdict, chosen = self._judge(rows)
        done = Retraining(
            time=state.time,
            n=state.n,
            why=why,
            **verdict._asdict(),
            rows=len(rows),
            what="" if chosen is None else chosen.what,
            onset=None if state.onset is None else float(rows.time[0]),
            epochs=0 if chosen is None else chosen.epochs,
        )
        if verdict.accepted and chosen is not None:
            running, posterior = chosen.calibration, chosen.covariance
            state = replace(
                state,
                running=running,
                covariance=describe_prior(running) if posterior is None else posterior,
                learned=state.n - len(split_off(rows)[1]),
            )
        state = schedule.close_retraining(state, self.params, done)
        self.state = state if verdict.poisoned else self._note(state, rows, done)
        return done

    def _note(self, state: RetrainerState, rows: Window, done: Retraining) -> RetrainerState:
        """The state with the noise and the reservoir that rows without fault say, unless what runs
        has to learn a change first."""
        running, unseen = state.running, split_off(rows)[1]
        if running is None or not (done.accepted or done.onset is None):
            return state
        left = compute_errors(candidates.correct(running, unseen), unseen.wanted)
        if state.noise is not None and acceptance.has_changed(left, state.noise, self.params):
            return state
        # unseen readings from which on they say how large the noise is
        if state.noise is None or len(unseen) >= 50:
            noise, correlation = acceptance.estimate_noise(left)
            state = replace(state, noise=noise, correlation=correlation)
        old = state.reservoir if done.onset is None else state.window.select(slice(0, 0))
        return replace(state, reservoir=candidates.add_rows(old, rows, running, state.n))

    def _judge(self, rows: Window) -> tuple[Judgement, candidates.Candidate | None]:
        """The best candidate of some rows, and whether it is to replace what is running."""
        state, params = self.state, self.params
        if wrong := acceptance.find_stuck(rows):
            return Judgement(False, wrong, True), None
        seen, unseen = split_off(rows)
        try:
            whole = state.onset is None and schedule.is_full(state, params)
            offered = candidates.train_candidates(state, params, seen, whole=whole)
        except AgonicError as error:
            return Judgement(False, f"nothing could be trained: {error}", True), None
        if not offered:
            return Judgement(False, f"{len(rows)} readings are too few to train on", False), None
        left = [one.errors(unseen) for one in offered]
        best = acceptance.choose_best(left)
        then = candidates.correct(offered[best].calibration, unseen)
        strength = float(np.sqrt(np.mean((then**2).sum(axis=1))))
        before, moves, others = None, 0.0, []
        if state.running is not None:
            now, kept = candidates.correct(state.running, unseen), state.reservoir
            before = compute_errors(now, unseen.wanted)
            moves = float(np.sqrt(np.mean(((then - now) ** 2).sum(axis=1)))) / strength
            if state.onset is None and len(kept):
                by_running = compute_errors(candidates.correct(state.running, kept), kept.wanted)
                others.append((offered[best].errors(kept), by_running))
        found = Unseen(before, left[best], moves, strength, state.noise)
        return acceptance.judge(found, params, *others), offered[best]

    @property
    def calibration(self) -> Running:
        """What corrects now.

        Raises `AgonicError` before the first training.
        """
        if self.state.running is None:
            raise AgonicError("nothing has been trained yet; update the retrainer first")
        return self.state.running

    @property
    def n(self) -> int:
        """How many readings were seen."""
        return self.state.n

    @property
    def retrainings(self) -> tuple[Retraining, ...]:
        """The last retrainings, accepted and rejected, at most a thousand."""
        return self.state.retrainings

    @property
    def findings(self) -> tuple[Finding, ...]:  # type: ignore[override]
        """What the user should know, by name."""
        return tuple(list_findings(self.state))

    @property
    def status(self) -> str:
        """What came of the retrainings, and the findings in words."""
        state = self.state
        said = f"{state.accepted} of {state.accepted + state.rejected} retrainings were accepted"
        if state.noise is not None:
            said += f"; what is running leaves {figure(state.noise)} nT on an axis"
        if state.accepted and state.covariance is None:
            said += (
                "; the state has no posterior of them, as those written before agonic kept one: it "
                "goes on from what the network states of itself, with an empty reservoir"
            )
        return sentences(*(finding.sentence for finding in self.findings), said)

    def save(self, path: Path | str) -> Path:
        """Write everything that `resume` needs to go on, in one step."""
        return save_retrainer(self.params, self.state, path)

    @classmethod
    def resume(cls, path: Path | str) -> Retrainer:
        """The retrainer that was saved, as if it had never stopped.

        Raises `LogError` where the file is missing, damaged or something else.
        """
        params, state = load_retrainer(path)
        retrainer = cls(None, params)
        retrainer.params, retrainer.state = params, state
        return retrainer
