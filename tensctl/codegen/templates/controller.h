/* A tensegrity controller (<< kind >>), written by tensctl << version >>.
 *
 * Call tensctl_step once every TENSCTL_PERIOD seconds. It allocates nothing and remembers the last step in one static
 * struct, so one program runs one controller.
 *
 * measurement: TENSCTL_MEASUREMENT doubles,
{% for part in measured %}
 *   << part >>
{% endfor %}
 * u: TENSCTL_INPUTS doubles, total changes of rest length from L0 (m, > 0 shortens), to be reached in a straight line by
{% if delay %}
 *   the end of a period that begins TENSCTL_DELAY seconds after the measurement, in this order:
{% else %}
 *   the end of the period, in this order:
{% endif %}
{% for label in inputs %}
 *   << label >>
{% endfor %}
 */
#ifndef TENSCTL_CONTROLLER_H
#define TENSCTL_CONTROLLER_H

#ifdef __cplusplus
extern "C" {
#endif

#define TENSCTL_MEASUREMENT << size >>
#define TENSCTL_INPUTS << inputs|length >>
#define TENSCTL_PERIOD << number(dt) >>
{% if delay %}
#define TENSCTL_DELAY << number(delay) >>
{% endif %}

/* How a step was answered. Hard limits hold in every case. */
enum tensctl_outcome {
    TENSCTL_OK = 0,       /* as designed */
    TENSCTL_RELAXED = 1,  /* tension floors cannot all be kept: relaxed by the least */
    TENSCTL_FALLBACK = 2, /* inputs as they come are too far beyond their bounds: what the last plan would do next */
{% if kind == "mpc" %}
    TENSCTL_REFUSED = 3,  /* the measurement tells nothing: what the last plan would do next */
{% else %}
    TENSCTL_REFUSED = 3,  /* the measurement has an entry that is no number: the last command again */
{% endif %}
    TENSCTL_BOUNDED = 4   /* the work was over before the optimum: no worse than the last plan; kkt says how far */
};

struct tensctl_report {
    int outcome;
    int iterations; /* changes of the active set; 0 without an optimisation */
    double kkt;     /* recomputed KKT residual; < 0 when there is no optimum to judge */
    double relaxed; /* by how much the worst tension floor gives way, N */
};

/* One step; returns an outcome. */
int tensctl_step(const double *measurement, double *u);

/* What happened in the last step. */
struct tensctl_report tensctl_last(void);

/* Forget earlier steps. */
void tensctl_reset(void);

#ifdef __cplusplus
}
#endif

#endif
