/* A condensed problem, one linear model at every stage:
 *   minimise z'Hz/2 + f'z,   lower <= z <= upper,   T z >= floors,   least <= z_k - z_(k-1) <= most
 * z are the inputs of all stages as deviations from where they should be, then one slack a stage when floors give way.
 * Rows are numbered in this order: bounds of the unknowns, tension floors, changes from stage to stage. */
struct problem {
    int stages, given; /* f = F g for so many given numbers */
    int seen;          /* the first so many of them move tensions: S g */
    double curvature;  /* in H, of each stage's slack */
    double price;      /* of slack, over the steepest cost in sight */
    double largest;    /* on H's diagonal */
    const double *H, *W, *f_from, *optimum_from, *tension_from, *tension_block, *row_size;
};

static const struct problem problems[] = {
{% for problem in problems %}
    << problem.initialiser >><< "," if not loop.last >>
{% endfor %}
};

enum {
    MOST_VARIABLES = HORIZON * INPUTS,
    MOST_UNKNOWNS = MOST_VARIABLES + HORIZON,
    MOST_FLOORS = HORIZON * TENSIONS,
    MOST_ROWS = MOST_UNKNOWNS + MOST_FLOORS + MOST_VARIABLES,
    CAPACITY = MOST_UNKNOWNS < MAX_ITERATIONS ? MOST_UNKNOWNS : MAX_ITERATIONS
};

static const double feasible = 1e-11; /* rows that are missed by less are kept, m */
static const double dependent = 1e-10; /* a row with less of it outside the active rows depends on them */
static const double accept = 1e-6; /* largest KKT residual of an answer */
static const double kept = 1e-9; /* a floor that is missed by less is kept, N */

/* An active set that was: where the next search begins. Sides are +1 lower, -1 upper. */
struct memory {
    int count, row[CAPACITY], side[CAPACITY];
};
