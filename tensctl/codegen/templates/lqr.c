static struct {
    struct tensctl_report report;
    int begun;
    double command[INPUTS];
} self;

int tensctl_step(const double *measurement, double *u)
{
    self.report.iterations = 0;
    self.report.kkt = -1.0;
    self.report.relaxed = 0.0;
    self.report.outcome = all_finite(TENSCTL_MEASUREMENT, measurement) ? TENSCTL_OK : TENSCTL_REFUSED;
    if (self.report.outcome == TENSCTL_OK) {
        double change[INPUTS] = {0.0};
{% if sees_inputs %}
        double start[STATES + INPUTS];
        state_of(measurement, measurement + 3 * NODES, start);
        for (int i = 0; i < INPUTS; i++) {
            start[STATES + i] = measurement[6 * NODES + i] - input_rest[i];
        }
        add_product(INPUTS, STATES + INPUTS, -1.0, K, start, change);
{% else %}
        double x[STATES];
        state_of(measurement, measurement + 3 * NODES, x);
        add_product(INPUTS, STATES, -1.0, K, x, change);
{% endif %}
        for (int i = 0; i < INPUTS; i++) {
            self.command[i] = clipped(input_rest[i] + change[i], input_lower[i], input_upper[i]);
        }
    } else if (!self.begun) {
        memcpy(self.command, input_rest, sizeof input_rest);
    }
    self.begun = 1;
    memcpy(u, self.command, sizeof self.command);
    return self.report.outcome;
}

struct tensctl_report tensctl_last(void)
{
    return self.report;
}

void tensctl_reset(void)
{
    memset(&self, 0, sizeof self);
}
