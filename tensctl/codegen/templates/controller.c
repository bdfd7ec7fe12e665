/* A tensegrity controller (<< kind >>), written by tensctl << version >>: see << name >>.h. */
#include "<< name >>.h"

#include <math.h>
#include <string.h>

enum {
    INPUTS = TENSCTL_INPUTS,
{% if charts %}
    NODES = << charts[0].nodes >>,
    AXES = << charts[0].dimension >>,
    RODS = << charts[0].rods|length >>,
    COORDINATES = << charts[0].size >>,
    MOTION = << charts[0].states >>, /* states of the nodes */
    MODES = MOTION / 2,
    STATES = MOTION<< " + INPUTS" if lag >>,
{% endif %}
{% for name, count, says in sizes %}
    << name >> = << count >><< "," if not loop.last >>{% if says %} /* << says >> */{% endif %}

{% endfor %}
};

{% for table in tables %}
<< table.declaration >>

{% endfor %}
{% include "vector.c" %}
{% if charts %}

{% include "chart.c" %}
{% endif %}

{% include kind ~ ".c" %}

{% include "step.c" %}
