"""``selfmodel suite evolve``: a policy for a task of dm_control's suite."""

from selfmodel.cli.commands import EvolvePolicy
from selfmodel.cli.output import print_json, print_lines
from selfmodel.cli.progress import display
from selfmodel.recovery.result import SearchBegins
from selfmodel.studies.training import POLICY, TrainingSettings, evolve_policy
from selfmodel.tasks.suite_bodies import EPISODE

EPISODES = 10
"""New episodes in which the policy is judged."""


def evolve(options: EvolvePolicy) -> None:
    """Evolve a policy for a task of the suite: its observation, its return, its random starts."""
    settings = TrainingSettings(
        hidden=options.neurons,
        pairs=options.population // 2,
        deviation=options.deviation,
        rate=options.rate,
        steps=options.steps,
        seed=options.seed,
    )
    with display() as show:
        show(SearchBegins("policy"))
        try:
            training = evolve_policy(
                *(options.robot, options.out, settings),
                generations=options.generations,
                threads=options.threads,
                on_event=show,
            )
        except KeyboardInterrupt as interruption:
            interruption.add_note(
                f"finished generations are kept in {options.out}; the same command continues"
            )
            raise
    returns = training.judged(EPISODES)
    generation, steps, seconds, *_ = training.rows[-1]
    if options.as_json:
        facts = {"robot": options.robot, "policy": str(options.out / POLICY), "seed": options.seed}
        cost = {"generations": int(generation), "steps": int(steps), "cpu_seconds": seconds}
        print_json({**facts, **cost, "returns": returns.tolist()})
        return
    print_lines(
        f"{options.out / POLICY}: {training.policy.description}",
        f"return in {EPISODES} new episodes: {returns.mean():.0f} of {EPISODE:,}, from "
        f"{returns.min():.0f} to {returns.max():.0f}",
        f"after {int(generation)} generations, {int(steps):,} control steps and {seconds:.0f} CPU "
        f"seconds",
    )
