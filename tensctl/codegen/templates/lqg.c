static struct {
    struct tensctl_report report;
    int begun, known; /* whether there was a step; whether there is an estimate */
    double estimate[ORDER], inputs[INPUTS], command[INPUTS];
} self;

/* The estimate goes on from the inputs that there are, to what the sensors show. */
static void update(const double *shown, const double *inputs)
{
    double surprise[SENSORS], next[ORDER] = {0.0};
    for (int i = 0; i < SENSORS; i++) {
        surprise[i] = shown[i] - sensors_rest[i];
    }
    add_product(SENSORS, INPUTS, -1.0, D, inputs, surprise);
    add_product(ORDER, SENSORS, 1.0, seen, surprise, next);
    if (self.known) {
        add_product(ORDER, ORDER, 1.0, Phi, self.estimate, next);
        add_product(ORDER, INPUTS, 1.0, before, self.inputs, next);
        add_product(ORDER, INPUTS, 1.0, now, inputs, next);
    }
    memcpy(self.estimate, next, sizeof next);
    memcpy(self.inputs, inputs, sizeof self.inputs);
    self.known = 1;
}

int tensctl_step(const double *measurement, double *u)
{
    self.report.iterations = 0;
    self.report.kkt = -1.0;
    self.report.relaxed = 0.0;
    self.report.outcome = all_finite(TENSCTL_MEASUREMENT, measurement) ? TENSCTL_OK : TENSCTL_REFUSED;
    if (self.report.outcome == TENSCTL_OK) {
        double inputs[INPUTS], change[INPUTS] = {0.0};
        for (int i = 0; i < INPUTS; i++) {
            inputs[i] = measurement[SENSORS + i] - input_rest[i];
        }
        update(measurement, inputs);
        add_product(INPUTS, ORDER, -1.0, C, self.estimate, change);
        add_product(INPUTS, INPUTS, -1.0, direct, inputs, change);
        for (int i = 0; i < INPUTS; i++) {
            self.command[i] = clipped(input_rest[i] + change[i], input_lower[i], input_upper[i]);
        }
    } else {
        if (!self.begun) {
            memcpy(self.command, input_rest, sizeof input_rest);
        }
        self.known = 0; /* a sample is missing: the estimate begins anew */
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
