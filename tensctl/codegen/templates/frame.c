/* Mean over the rods' mass of a nodal field. */
static void mean_over_mass(const struct chart *chart, const double *field, double *mean)
{
    double mass = 0.0;
    mean[0] = mean[1] = mean[2] = 0.0;
    for (int r = 0; r < PIECES; r++) {
        const struct piece *piece = &chart->pieces[r];
        mass += piece->mass;
        for (int i = 0; i < 3; i++) {
            mean[i] += piece->mass * 0.5 * (field[3 * piece->tail + i] + field[3 * piece->head + i]);
        }
    }
    for (int i = 0; i < 3; i++) {
        mean[i] /= mass;
    }
}

/* M += integral over a rod's mass of a b', from centres and vectors. */
static void add_moment(double mass, const double *a, const double *a_vector, const double *b, const double *b_vector,
                       double M[3][3])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            M[i][j] += mass * (a[i] * b[j] + a_vector[i] * b_vector[j] / 12.0);
        }
    }
}

{% if charts[0].dimension == 2 %}
/* The best turn in the plane, from the reference to the world. */
static void best_rotation(double M[3][3], double R[3][3])
{
    double angle = atan2(M[1][0] - M[0][1], M[0][0] + M[1][1]);
    double c = cos(angle), s = sin(angle);
    double turn[3][3] = {{c, -s, 0.0}, {s, c, 0.0}, {0.0, 0.0, 1.0}};
    memcpy(R, turn, sizeof turn);
}
{% else %}
/* One Jacobi rotation of a symmetric 4 x 4 matrix in the plane (p, q), and of the vectors V beside it. */
static void jacobi(double N[4][4], double V[4][4], int p, int q)
{
    if (N[p][q] == 0.0) {
        return;
    }
    double theta = (N[q][q] - N[p][p]) / (2.0 * N[p][q]);
    double t = (theta >= 0.0 ? 1.0 : -1.0) / (fabs(theta) + sqrt(1.0 + theta * theta));
    double c = 1.0 / sqrt(1.0 + t * t), s = t * c;
    for (int k = 0; k < 4; k++) {
        double a = N[k][p], b = N[k][q];
        N[k][p] = c * a - s * b;
        N[k][q] = s * a + c * b;
    }
    for (int k = 0; k < 4; k++) {
        double a = N[p][k], b = N[q][k];
        N[p][k] = c * a - s * b;
        N[q][k] = s * a + c * b;
        a = V[k][p];
        b = V[k][q];
        V[k][p] = c * a - s * b;
        V[k][q] = s * a + c * b;
    }
}

/* The proper rotation from the reference to the world that fits best, as the quaternion of Horn (1987). */
static void best_rotation(double M[3][3], double R[3][3])
{
    double N[4][4] = {
        {M[0][0] + M[1][1] + M[2][2], M[2][1] - M[1][2], M[0][2] - M[2][0], M[1][0] - M[0][1]},
        {M[2][1] - M[1][2], M[0][0] - M[1][1] - M[2][2], M[1][0] + M[0][1], M[0][2] + M[2][0]},
        {M[0][2] - M[2][0], M[1][0] + M[0][1], M[1][1] - M[0][0] - M[2][2], M[2][1] + M[1][2]},
        {M[1][0] - M[0][1], M[0][2] + M[2][0], M[2][1] + M[1][2], M[2][2] - M[0][0] - M[1][1]}};
    double V[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 12; sweep++) {
        for (int p = 0; p < 3; p++) {
            for (int q = p + 1; q < 4; q++) {
                jacobi(N, V, p, q);
            }
        }
    }
    int best = 0;
    for (int k = 1; k < 4; k++) {
        best = N[k][k] > N[best][best] ? k : best;
    }
    double w = V[0][best], x = V[1][best], y = V[2][best], z = V[3][best];
    double square = w * w + x * x + y * y + z * z;
    double turn[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            R[i][j] = turn[i][j] / square;
        }
    }
}
{% endif %}

static void cross3(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Spin of the mass: inertia^-1 times angular momentum, by Cramer's rule. */
static void spin_of(double now[3][3], double moving[3][3], double *spin)
{
    double trace = now[0][0] + now[1][1] + now[2][2], row[3][3], others[3][3];
    double momentum[3] = {moving[1][2] - moving[2][1], moving[2][0] - moving[0][2], moving[0][1] - moving[1][0]};
{% if charts[0].dimension == 2 %}
    (void)row;
    (void)others;
    spin[0] = spin[1] = 0.0;
    spin[2] = momentum[2] / (trace - now[2][2]);
{% else %}
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            row[i][j] = (i == j ? trace : 0.0) - now[i][j];
        }
    }
    for (int i = 0; i < 3; i++) {
        cross3(row[(i + 1) % 3], row[(i + 2) % 3], others[i]);
    }
    double determinant = row[0][0] * others[0][0] + row[0][1] * others[0][1] + row[0][2] * others[0][2];
    for (int i = 0; i < 3; i++) {
        spin[i] = (others[0][i] * momentum[0] + others[1][i] * momentum[1] + others[2][i] * momentum[2]) / determinant;
    }
{% endif %}
}

/* Nodes and velocities of a free structure as its co-moving frame sees them. */
static void seen_from_frame(const struct chart *chart, const double *nodes, const double *velocities, double *seen,
                            double *seen_rate)
{
    double centre[3], drift[3], fit[3][3] = {{0}}, now[3][3] = {{0}}, moving[3][3] = {{0}}, R[3][3], spin[3];
    mean_over_mass(chart, nodes, centre);
    mean_over_mass(chart, velocities, drift);
    for (int r = 0; r < PIECES; r++) {
        const struct piece *piece = &chart->pieces[r];
        double middle[3], vector[3], middle_rate[3], vector_rate[3];
        for (int i = 0; i < 3; i++) {
            double tail = nodes[3 * piece->tail + i], head = nodes[3 * piece->head + i];
            double tail_rate = velocities[3 * piece->tail + i], head_rate = velocities[3 * piece->head + i];
            middle[i] = 0.5 * (tail + head) - centre[i];
            vector[i] = head - tail;
            middle_rate[i] = 0.5 * (tail_rate + head_rate) - drift[i];
            vector_rate[i] = head_rate - tail_rate;
        }
        add_moment(piece->mass, middle, vector, piece->middle, piece->vector, fit);
        add_moment(piece->mass, middle, vector, middle, vector, now);
        add_moment(piece->mass, middle, vector, middle_rate, vector_rate, moving);
    }
    best_rotation(fit, R);
    spin_of(now, moving, spin);
    for (int k = 0; k < NODES; k++) {
        double away[3], carried[3];
        for (int i = 0; i < 3; i++) {
            away[i] = nodes[3 * k + i] - centre[i];
        }
        cross3(spin, away, carried);
        for (int j = 0; j < 3; j++) {
            seen[3 * k + j] = chart->centre[j];
            seen_rate[3 * k + j] = 0.0;
            for (int i = 0; i < 3; i++) {
                seen[3 * k + j] += away[i] * R[i][j];
                seen_rate[3 * k + j] += (velocities[3 * k + i] - drift[i] - carried[i]) * R[i][j];
            }
        }
    }
}
