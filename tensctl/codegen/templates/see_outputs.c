{% include "filter.c" %}

{% include "target.c" %}

/* State and inputs when the command of this step begins to act, deviations from the target; inputs and tensions
 * there<< ", and what the motion of the course adds to all of them" if moves >>. */
static const struct problem *see(const double *measurement)
{
    double change[INPUTS], margin[TENSIONS];
    const double *d = self.estimate + STATES;
    for (int i = 0; i < INPUTS; i++) {
        change[i] = self.now[i] - input_rest[i];
    }
{% if lag %}
    if (!self.known) {
        for (int i = 0; i < INPUTS; i++) {
            self.estimate[STATES - INPUTS + i] = self.actual[i] - input_rest[i];
        }
    }
{% endif %}
    estimate(measurement, change);
    aim();
{% if delay %}
    /* x(delay) = F x + G0 u + G1 u' + E d,   u' the command that is under way: it is reached by then. */
    double coming[INPUTS];
    for (int i = 0; i < INPUTS; i++) {
        coming[i] = self.begins[i] - input_rest[i];
    }
    memset(self.given, 0, sizeof self.given);
    add_product(STATES, STATES, 1.0, until_F, self.estimate, self.given);
    add_product(STATES, INPUTS, 1.0, until_G0, change, self.given);
    add_product(STATES, INPUTS, 1.0, until_G1, coming, self.given);
    add_product(STATES, SENSORS, 1.0, until_E, d, self.given);
{% else %}
    memcpy(self.given, self.estimate, STATES * sizeof self.given[0]);
{% endif %}
    for (int i = 0; i < INPUTS; i++) {
        self.given[STATES + i] = self.begins[i] - input_rest[i];
    }
    for (int i = 0; i < STATES + INPUTS; i++) {
        self.given[i] -= self.target[i];
    }
    for (int k = 0; k < MOST_VARIABLES + INPUTS; k++) {
        self.about[k] = input_rest[k % INPUTS] + self.target[STATES + k % INPUTS];
    }
    memcpy(margin, margin_rest, sizeof margin);
    add_product(TENSIONS, STATES + INPUTS, 1.0, tension_from_rest, self.target, margin);
    add_product(TENSIONS, SENSORS, 1.0, tension_shown, d, margin);
    for (int k = 0; k < MOST_FLOORS; k++) {
        self.margin[k] = margin[k % TENSIONS];
    }
{% if moves %}
    const int at = ahead(0);
    for (int i = 0; i < STATES; i++) {
        self.given[i] -= course_motion[at * STATES + i];
    }
{% if lag %}
    for (int i = 0; i < INPUTS; i++) {
        self.given[STATES + i] -= course_commands[at * INPUTS + i] - course_inputs[at * INPUTS + i];
    }
{% endif %}
    for (int j = 0; j <= HORIZON; j++) {
        const double *then = << "course_commands" if lag else "course_inputs" >> + ahead(j) * INPUTS;
        for (int i = 0; i < INPUTS; i++) {
            self.about[j * INPUTS + i] += then[i] - course_inputs[at * INPUTS + i];
        }
        for (int i = 0; i < TENSIONS && j > 0; i++) {
            double grown = course_tension[ahead(j) * TENSIONS + i] - course_tension[at * TENSIONS + i];
            self.margin[(j - 1) * TENSIONS + i] += grown;
        }
    }
{% endif %}
    return &problems[0];
}
