/* A tensegrity controller (<< kind >>), written by tensctl << version >>: see << name >>.h. */
#include "<< name >>.h"

#include <math.h>
#include <string.h>

enum {
    INPUTS = TENSCTL_INPUTS,
{% if chart %}
    NODES = << chart.nodes >>,
    AXES = << chart.dimension >>,
    RODS = << chart.rods|length >>,
    COORDINATES = << chart.size >>,
    STATES = << chart.states >>,
    MODES = STATES / 2<< "," if kind == "mpc" >>
{% endif %}
{% if kind == "lqg" %}
    SENSORS = << sensors >>,
    ORDER = << order >>
{% endif %}
{% if kind == "mpc" %}
    START = STATES + INPUTS,
    HORIZON = << horizon >>,
    TENSIONS = << tensions >>, /* tension rows of a stage */
    MAX_ITERATIONS = << max_iterations >>
{% endif %}
};

{% for table in tables %}
<< table.declaration >>

{% endfor %}
{% include "vector.c" %}
{% if chart %}

{% include "chart.c" %}
{% endif %}

{% include kind ~ ".c" %}

{% include "step.c" %}
