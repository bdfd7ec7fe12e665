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

static void answer(const double *measurement)
{
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
}
