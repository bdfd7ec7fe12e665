/* Where a search may begin when the last plan is far from the optimum: every input changes at a constant rate, over the
 * whole horizon first, then over each half of it.
 *   z = now + E v,   v the changes in each part, E spreads them evenly over the L stages of a part
 *   minimise v'(E'G E)v/2 + (g + G now)'E v + L price sum eps + L c |eps|^2/2,   M E v + eps >= floor - M now,
 *   one eps a part,   rates and inputs within the narrowest of their limits in a part
 * It is the problem of the primal search with parts for stages. */

/* A problem is set aside with its point while another one is searched. */
static void set_aside(struct aside *aside)
{
    aside->problem = self.problem;
    memcpy(aside->gradient, self.gradient, sizeof aside->gradient);
    memcpy(aside->lower, self.lower, sizeof aside->lower);
    memcpy(aside->upper, self.upper, sizeof aside->upper);
    memcpy(aside->value, self.value, sizeof aside->value);
    aside->kkt = self.report.kkt;
}

static void take_back_problem(const struct aside *aside)
{
    choose(aside->problem);
    memcpy(self.gradient, aside->gradient, sizeof self.gradient);
    memcpy(self.lower, aside->lower, sizeof self.lower);
    memcpy(self.upper, aside->upper, sizeof self.upper);
}

static void take_back_point(const struct aside *aside)
{
    memcpy(self.value, aside->value, sizeof self.value);
    self.report.kkt = aside->kkt;
}

/* Cost of the point; slope and values anew. */
static double cost(void)
{
    double sum = 0.0;
    see_slope();
    for (int e = 0; e < self.entries; e++) {
        sum += is_row(e) ? 0.0 : 0.5 * self.value[e] * (self.gradient[e] + self.slope[e]);
    }
    return sum;
}

/* Limits of an input and its rate, and the slope by its change, in a part of the horizon. */
static void pose_part(const struct aside *whole, int part, int input, double now)
{
    int v = part * INPUTS + input, end = self.inputs_from + v, from = part_begins(part), to = part_begins(part + 1);
    double least = -HUGE_VAL, most = HUGE_VAL, low = -HUGE_VAL, high = HUGE_VAL, slope = 0.0;
    for (int k = from; k < to; k++) {
        int w = k * INPUTS + input, z = MOST_VARIABLES + MOST_FLOORS + w;
        double begun = k == 0 ? now : 0.0; /* the first rate counts from no input */
        least = larger(least, whole->lower[w] - begun);
        most = smaller(most, whole->upper[w] - begun);
        low = larger(low, whole->lower[z] - now);
        high = smaller(high, whole->upper[z] - now);
        slope += whole->slope[w];
    }
    self.lower[v] = (to - from) * least;
    self.upper[v] = (to - from) * most;
    self.lower[end] = low;
    self.upper[end] = high;
    self.gradient[v] = slope / (to - from);
}

/* The problem with so few rates, from the whole one that was set aside with slope and tensions where inputs stay. */
static void pose_rough(const struct problem *rough, const struct aside *whole, const double *now)
{
    choose(rough);
    for (int v = 0; v < self.variables; v++) {
        pose_part(whole, v / INPUTS, v % INPUTS, now[v % INPUTS]);
    }
    for (int k = 0; k < MOST_FLOORS; k++) {
        self.lower[self.variables + k] = whole->lower[MOST_VARIABLES + k] - whole->tension[k];
        self.upper[self.variables + k] = HUGE_VAL;
    }
    for (int s = 0; s < rough->stages; s++) {
        int e = self.slacks_from + s;
        self.gradient[e] = rough->price * whole->gradient[MOST_ENTRIES - HORIZON];
        self.lower[e] = 0.0;
        self.upper[e] = HUGE_VAL;
    }
}

/* Slope and tensions of the problem that was set aside, where inputs stay as they are now. */
static void see_stay(struct aside *whole, const double *now)
{
    memcpy(whole->slope, whole->gradient, sizeof whole->slope);
    memset(whole->tension, 0, sizeof whole->tension);
    for (int i = 0; i < INPUTS; i++) {
        add_curved(i, now[i], whole->slope);
        add_tensions(i, now[i], whole->tension);
    }
}

/* A plan whose inputs change evenly in each part, from one nearby: its inputs at the ends of parts. */
static void plan_roughly(const struct problem *rough, const struct aside *whole, const double *now, double *plan)
{
    pose_rough(rough, whole, now);
    for (int v = 0; v < self.variables; v++) {
        plan[v] = plan[(part_begins(v / INPUTS + 1) - 1) * INPUTS + v % INPUTS] - now[v % INPUTS];
    }
    memset(self.value, 0, sizeof self.value);
    search_primal(plan, rough->work, roughly);
    self.report.iterations += self.iterations;
    for (int part = 0; part < rough->stages; part++) {
        int from = part_begins(part), to = part_begins(part + 1);
        for (int j = from * INPUTS; j < to * INPUTS; j++) {
            double before = j < INPUTS ? now[j] : plan[j - INPUTS];
            plan[j] = before + self.value[part * INPUTS + j % INPUTS] / (to - from);
        }
    }
}

/* Search again from constant rates; the plan that costs less is the answer, and how its search ended is returned. */
static int searched_again(double *plan, const double *now)
{
    struct aside *whole = &self.room.aside;
    double first = cost();
    set_aside(whole);
    see_stay(whole, now);
    for (const struct problem *rough = whole->problem->rough; rough != NULL; rough = rough->rough) {
        plan_roughly(rough, whole, now, plan);
    }
    take_back_problem(whole);
    int ended = searched(plan, once_more * self.problem->work);
    if (ended != GIVEN_UP && cost() < first) {
        return ended;
    }
    take_back_point(whole);
    return BOUNDED;
}
