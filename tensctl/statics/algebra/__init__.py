"""Connectivity algebra: equilibria of any network of bars and strings by linear algebra alone ([W]).

`Network` is the graph, `ranks` what it alone decides, `five_steps` the construction of a structure in equilibrium and
`admissible_ratios` the coefficients at which one exists. Every function is named after what it computes or after the
lemma that it states; matrices keep the letters of [W], except its incidence matrices S, B, D: C_s, C_b, C_w.
"""

from tensctl.statics.algebra.bars import BarCondition, lemma19
from tensctl.statics.algebra.class_one import corollary13, corollary14, end_selectors
from tensctl.statics.algebra.configuration import Configuration, check_bar_lengths, force_density_matrix
from tensctl.statics.algebra.construction import five_steps
from tensctl.statics.algebra.forest import Forest, spanning_forest
from tensctl.statics.algebra.graph_ranks import Ranks, ranks
from tensctl.statics.algebra.incidence_matrices import incidence, load_incidence
from tensctl.statics.algebra.kronecker import SVD, LinearSolutions, kron, solve, stack, svd, unstack
from tensctl.statics.algebra.loads import LoadTerms, lemma23, theorem22
from tensctl.statics.algebra.loops import NodeCount, loop_gaps, loop_matrix, node_count
from tensctl.statics.algebra.network import Network, component_labels
from tensctl.statics.algebra.rank_decision import RankDecision, decide_rank
from tensctl.statics.algebra.ratios import Ratios, admissible_ratios
from tensctl.statics.algebra.shape import Shapes, theorem21
from tensctl.statics.algebra.steps import FiveSteps
from tensctl.statics.algebra.strings import StringForces, StringSpace, lemma17, lemma18
from tensctl.statics.algebra.transformation import (
    Transformation,
    bar_coordinates,
    forest_transformation,
    theorem11,
)

__all__ = [
    "SVD",
    "BarCondition",
    "Configuration",
    "FiveSteps",
    "Forest",
    "LinearSolutions",
    "LoadTerms",
    "Network",
    "NodeCount",
    "RankDecision",
    "Ranks",
    "Ratios",
    "Shapes",
    "StringForces",
    "StringSpace",
    "Transformation",
    "admissible_ratios",
    "bar_coordinates",
    "check_bar_lengths",
    "component_labels",
    "corollary13",
    "corollary14",
    "decide_rank",
    "end_selectors",
    "five_steps",
    "force_density_matrix",
    "forest_transformation",
    "incidence",
    "kron",
    "lemma17",
    "lemma18",
    "lemma19",
    "lemma23",
    "load_incidence",
    "loop_gaps",
    "loop_matrix",
    "node_count",
    "ranks",
    "solve",
    "spanning_forest",
    "stack",
    "svd",
    "theorem11",
    "theorem21",
    "theorem22",
    "unstack",
]
