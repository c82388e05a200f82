"""One scenario: every car plans for itself; how did each of them end?"""

import interdrive as idr


def main() -> None:
    run = idr.simulate("t_junction", agents="all")
    for agent, outcome, time_step in zip(
        run.outcomes.agent_id, run.outcomes.outcome, run.outcomes.time_step, strict=True
    ):
        print(f"agent {agent}: {outcome} after {time_step * run.scenario.dt:.1f} s")
    reached = run.outcomes.outcome.count("goal_reached")
    print(f"{reached} of {len(run.outcomes.outcome)} agents reached their goal in time")


if __name__ == "__main__":
    main()
