/* Slopes by inputs from those by rates: a rate moves its input in all later stages. */
static void by_inputs(double *slope)
{
    for (int j = 0; j + INPUTS < self.variables; j++) {
        slope[j] -= slope[j + INPUTS];
    }
}

/* How far the values and forces are from optimal, recomputed from the problem's own data: stationarity by inputs,
 * limits that are broken and forces of limits that are not met, each over the size of its terms. 0 is exact. */
static double kkt_residual(void)
{
    double *pull = self.slope, *push = self.push, *cost = self.slope_change, tiny = 1e-150;
    double broken = 0.0, width = tiny, off = 0.0, largest = tiny, slack = 0.0;
    see_values();
    memset(pull, 0, sizeof self.slope);
    memset(push, 0, sizeof self.push);
    memcpy(cost, self.gradient, sizeof self.gradient);
    for (int e = 0; e < self.entries; e++) {
        broken = larger(broken, outside(e));
        width = larger(width, fabs(self.value[e]));
        if (!is_row(e)) {
            add_curved(e, self.value[e], pull);
            push[e] -= self.force[e];
        } else if (self.force[e] != 0.0) {
            add_row(e, -self.force[e], push);
        }
    }
    by_inputs(pull);
    by_inputs(push);
    by_inputs(cost);
    for (int e = 0; e < self.entries; e++) {
        if (e < self.variables || (self.relaxed && e >= self.slacks_from)) {
            off = larger(off, fabs(pull[e] + cost[e] + push[e]));
            largest = larger(larger(largest, fabs(pull[e])), larger(fabs(cost[e]), fabs(push[e])));
        }
    }
    for (int e = 0; e < self.entries; e++) {
        double gap = fabs((self.force[e] > 0.0 ? self.lower[e] : self.upper[e]) - self.value[e]);
        if (self.force[e] != 0.0) {
            slack = larger(slack, fabs(self.force[e]) * smaller(gap, width));
        }
    }
    double strongest = larger(largest_of(self.entries, self.force), largest);
    return larger(larger(off / largest, broken / width), slack / (strongest * width));
}
