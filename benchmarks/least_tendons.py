"""How many tendons does a stable shell need? [S] names 8 n m, the primal shell, as the least.

Takes tendons away from primal shells, one at a time and orbit by orbit (all n of one number in one stage), finds the
equilibrium again and asks whether it is stable, with every remaining tendon taut.

python benchmarks/least_tendons.py
"""

from collections import Counter
from dataclasses import replace

import tensctl as tc

SIZES = ((3, 1), (3, 2), (4, 2))


def without(structure: tc.Structure, labels: set[str]) -> tc.Structure:
    """The structure without some tendons."""
    kept = [t for t, label in enumerate(structure.tendon_labels) if label not in labels]
    names = tuple(structure.tendon_labels[t] for t in kept)
    return replace(structure, tendons=structure.tendons[kept], tendon_labels=names)


def verdict(structure: tc.Structure) -> str:
    """Taut and stable, stable with slack tendons, or why not."""
    scene = tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    try:
        rest = tc.find_equilibrium(scene)
    except tc.TensctlError:
        return "no equilibrium"
    if not rest.stable:
        return str(rest.stable) if rest.stable != tc.Stability.NO else "unstable"
    return "stable, taut" if (rest.tensions > 0).all() else "stable, some slack"


def orbits(structure: tc.Structure) -> dict[str, set[str]]:
    """Labels of the tendons of one number in one stage."""
    found: dict[str, set[str]] = {}
    for label in structure.tendon_labels:
        number, _, stage = label.split("_")
        found.setdefault(f"{number} in stage {stage}", set()).add(label)
    return found


def fewest(shell: tc.Structure) -> None:
    """Take away one orbit after the other, each time the one whose loss leaves the stiffest stable, taut shell."""
    gone = []
    while True:
        choices = []
        for name, labels in orbits(shell).items():
            left = without(shell, labels)
            if verdict(left) == "stable, taut":
                rest = tc.find_equilibrium(tc.Scene(structure=left, tendons={"stiffness": 100.0, "rest_ratio": 0.8}))
                choices.append((rest.smallest, name, left))
        if not choices:
            break
        _, name, shell = max(choices, key=lambda choice: choice[0])
        gone.append(name)
    rest = tc.find_equilibrium(tc.Scene(structure=shell, tendons={"stiffness": 100.0, "rest_ratio": 0.8}))
    print(f"  orbit by orbit down to {len(shell.tendons)} tendons, stable, taut, smallest omega^2 {rest.smallest:.3g}")
    print(f"    taken away in turn: {', '.join(gone)}")


def main() -> None:
    """Print what can be taken away."""
    for n, m in SIZES:
        shell = tc.shell(n, m, primal=True)
        print(f"\n({n},{m}) primal, {len(shell.tendons)} = 8nm tendons: {verdict(shell)}")
        total = 0
        for orbit, labels in orbits(shell).items():
            found = Counter(verdict(without(shell, {label})) for label in labels)
            total += sum(count for word, count in found.items() if word.startswith("stable"))
            print(f"  {orbit}: one away {dict(found)}; all {n} away: {verdict(without(shell, labels))}")
        print(f"  {total} of {len(shell.tendons)} tendons can each be taken away alone with a stable equilibrium left")
        fewest(shell)


if __name__ == "__main__":
    main()
