/* Kalman filter of z = (x, d), d the constant disturbances, deviations from the equilibrium:
 *   predict   z = F z + G_0 u_(k-1) + G_1 u_k,   P = F P F' + W
 *   update    z = z + L (y - D u - H z),   L = P H'(H P H' + V)^-1,   P = (1 - L H) P (1 - L H)' + L V L'
 * While every sensor speaks P is constant and so is L. Where values are missing or absurd P grows, row by row of those
 * that are there: V is diagonal, so taking one after the other is the same. */
static const double absurd_size = << number(absurd) >>; /* deviations, and as many times the median sensor's */
static const int patience = << patience >>; /* a sensor that says the same absurd thing for longer is believed */
static const double constant_again = << number(back) >>; /* of deviations: P is taken for the constant one */

/* P, (ORDER, ORDER), at this sample. */
static const double *covariance(void)
{
    return self.varies ? &self.P[0][0] : filter_X;
}

/* x = F x of the states, a column of z that is `stride` apart; disturbances stay. */
static void carry(double *z, int stride)
{
    double next[STATES] = {0.0}, flat[ORDER];
    for (int i = 0; i < ORDER; i++) {
        flat[i] = z[i * stride];
    }
    add_product(STATES, STATES, 1.0, filter_F, flat, next);
    add_product(STATES, SENSORS, 1.0, filter_after, flat + STATES, next);
    for (int i = 0; i < STATES; i++) {
        z[i * stride] = next[i];
    }
}

/* Deviation that each innovation should have, squared. */
static double variance_of(int sensor)
{
    const double *h = filter_H + sensor * ORDER, *P = covariance();
    double sum = filter_noise[sensor] * filter_noise[sensor];
    for (int i = 0; i < ORDER; i++) {
        for (int j = 0; j < ORDER; j++) {
            sum += h[i] * P[i * ORDER + j] * h[j];
        }
    }
    return sum;
}

/* Median of n numbers, which are put in order. */
static double median_of(int n, double *x)
{
    for (int k = 1; k < n; k++) {
        double value = x[k];
        int i = k;
        for (; i > 0 && x[i - 1] > value; i--) {
            x[i] = x[i - 1];
        }
        x[i] = value;
    }
    return n % 2 ? x[n / 2] : 0.5 * (x[n / 2 - 1] + x[n / 2]);
}

/* Mark the sensors whose values are there and not absurd; how many are not to be used. */
static int choose_sensors(const double *innovation, const int *there, int *used)
{
    double size[SENSORS], sorted[SENSORS], usual = 1.0;
    int count = 0, left = 0;
    for (int s = 0; s < SENSORS; s++) {
        size[s] = fabs(innovation[s]) / (self.varies ? sqrt(variance_of(s)) : filter_deviation[s]);
        if (there[s]) {
            sorted[count++] = size[s];
        }
    }
    if (count > 0) {
        double middle = median_of(count, sorted);
        usual = middle > 1.0 ? middle : 1.0;
    }
    for (int s = 0; s < SENSORS; s++) {
        int refused = there[s] && size[s] > absurd_size * usual && self.absurd[s] < patience;
        used[s] = there[s] && !refused;
        self.absurd[s] = refused ? self.absurd[s] + 1 : there[s] ? 0 : self.absurd[s];
        left += !used[s];
    }
    return left;
}

/* Take one value into the mean's change and into P. */
static void take_value(int sensor, double innovation, double *change)
{
    const double *h = filter_H + sensor * ORDER;
    double across[ORDER], gain[ORDER], rest[ORDER], noise = filter_noise[sensor] * filter_noise[sensor], sum = noise;
    for (int i = 0; i < ORDER; i++) {
        across[i] = 0.0;
        for (int j = 0; j < ORDER; j++) {
            across[i] += self.P[i][j] * h[j];
        }
    }
    for (int i = 0; i < ORDER; i++) {
        sum += h[i] * across[i];
        innovation -= h[i] * change[i];
    }
    for (int i = 0; i < ORDER; i++) {
        gain[i] = across[i] / sum;
        change[i] += gain[i] * innovation;
        rest[i] = 0.0;
        for (int j = 0; j < ORDER; j++) {
            self.P[i][j] -= gain[i] * across[j];
            rest[i] += self.P[i][j] * h[j];
        }
    }
    for (int i = 0; i < ORDER; i++) {
        for (int j = 0; j < ORDER; j++) {
            self.P[i][j] += (gain[i] * noise - rest[i]) * gain[j];
        }
    }
}

/* P a period later, and whether it still differs from the constant one. */
static void carry_covariance(void)
{
    double widest = 0.0;
    for (int j = 0; j < ORDER; j++) {
        carry(&self.P[0][j], ORDER);
        widest = filter_X[j * ORDER + j] > widest ? filter_X[j * ORDER + j] : widest;
    }
    for (int i = 0; i < ORDER; i++) {
        carry(self.P[i], 1);
    }
    self.varies = 0;
    for (int i = 0; i < ORDER; i++) {
        for (int j = 0; j <= i; j++) {
            double middle = 0.5 * (self.P[i][j] + self.P[j][i]) + filter_W[i * ORDER + j];
            double off = fabs(middle - filter_X[i * ORDER + j]);
            self.P[i][j] = self.P[j][i] = middle;
            self.varies |= off > constant_again * (i == j ? filter_X[i * ORDER + i] : widest);
        }
    }
}

/* The estimate at this sample, from what sensors show and the inputs u, a deviation from the equilibrium. */
static void estimate(const double *shown, const double *u)
{
    double innovation[SENSORS], change[ORDER] = {0.0};
    int there[SENSORS], used[SENSORS];
    if (self.known) {
        carry(self.estimate, 1);
        add_product(STATES, INPUTS, 1.0, filter_G0, self.inputs, self.estimate);
        add_product(STATES, INPUTS, 1.0, filter_G1, u, self.estimate);
    }
    for (int s = 0; s < SENSORS; s++) {
        there[s] = is_number(shown[s]);
        innovation[s] = there[s] ? shown[s] - sensors_rest[s] : 0.0;
    }
    add_product(SENSORS, INPUTS, -1.0, filter_D, u, innovation);
    add_product(SENSORS, ORDER, -1.0, filter_H, self.estimate, innovation);
    for (int s = 0; s < SENSORS; s++) {
        innovation[s] = there[s] ? innovation[s] : 0.0;
    }
    if (choose_sensors(innovation, there, used) == 0 && !self.varies) {
        add_product(ORDER, SENSORS, 1.0, filter_gain, innovation, change);
    } else {
        memmove(self.P, covariance(), sizeof self.P);
        for (int s = 0; s < SENSORS; s++) {
            if (used[s]) {
                take_value(s, innovation[s], change);
            }
        }
        carry_covariance();
    }
    for (int i = 0; i < ORDER; i++) {
        self.estimate[i] += change[i];
    }
    memcpy(self.inputs, u, sizeof self.inputs);
    self.known = 1;
}
