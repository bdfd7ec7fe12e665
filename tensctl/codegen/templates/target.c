/* Where to rest under the disturbances d, the target of offset-free control:
 *   minimise  |N^-1 (G u + G_d d - r)|^2 + rho v'R v + sigma (v - v_last)'R(v - v_last),   v = u - u_r,
 *   u and tensions at rest within their limits
 * a problem of one stage whose given numbers are d, r and u_r + sigma / (rho + sigma) v_last. Without an answer the last
 * target stays. */
static const double target_kept = << number(kept) >>; /* sigma / (rho + sigma) */
static const struct problem target_problem = << target.initialiser >>;

static void aim(void)
{
    const double *d = self.estimate + STATES, *near = course_inputs + ahead(0) * INPUTS;
    double given[SENSORS + TRACKED + INPUTS];
    memcpy(given, d, SENSORS * sizeof given[0]);
    memcpy(given + SENSORS, course_tracked + ahead(0) * TRACKED, TRACKED * sizeof given[0]);
    for (int i = 0; i < INPUTS; i++) {
        given[SENSORS + TRACKED + i] = near[i] - input_rest[i] + target_kept * self.beside[i];
    }
    pose(&target_problem, given, margin_rest);
    for (int i = 0; i < INPUTS; i++) {
        self.lower[i] = target_lower[i];
        self.upper[i] = target_upper[i];
        self.lower[self.inputs_from + i] = -HUGE_VAL; /* of one stage rates are inputs */
        self.upper[self.inputs_from + i] = HUGE_VAL;
    }
    if (solved(self.target + STATES, NULL) != GIVEN_UP && self.report.kkt <= accept) {
        memset(self.target, 0, sizeof self.target);
        for (int i = 0; i < INPUTS; i++) {
            self.target[STATES + i] = clipped(self.value[i], target_lower[i], target_upper[i]);
            self.beside[i] = self.target[STATES + i] - (near[i] - input_rest[i]);
        }
        add_product(STATES, INPUTS, 1.0, rest_from_inputs, self.target + STATES, self.target);
        add_product(STATES, SENSORS, 1.0, rest_from_disturbances, d, self.target);
    }
    self.report.kkt = -1.0; /* the plan's is reported */
}
