#include "grouser/detector.h"

#include <math.h>
#include <string.h>

/* Share of a column's width by which a row may pass the box: rounding to float32 is no excursion. */
static const double EDGE_TOLERANCE = 1e-6;

void grouser_detector_init(grouser_detector *detector, int columns, const double *low, const double *high,
                           const double *center, const double *whitening, double threshold) {
  memset(detector, 0, sizeof *detector);
  detector->columns = columns;
  detector->threshold = threshold;
  for (int i = 0; i < columns; i++) {
    const double half_width = (high[i] - low[i]) / 2;
    const double least = EDGE_TOLERANCE * fmax(fabs(low[i]), fabs(high[i]));
    const double reach = half_width > least ? half_width : least;
    detector->low[i] = low[i];
    detector->high[i] = high[i];
    detector->center[i] = center[i];
    detector->reach[i] = reach > 0 ? reach : 1.0;
    detector->slack[i] = 2 * EDGE_TOLERANCE * detector->reach[i];
    for (int j = 0; j < columns; j++) detector->whitening[j][i] = whitening[i * columns + j];
  }
}

/* A row and what is computed of it, padded with zeros. */
typedef struct {
  double x[GROUSER_PADDED_COLUMNS], offset[GROUSER_PADDED_COLUMNS], white[GROUSER_PADDED_COLUMNS];
} padded_row;

static void pad_row(const grouser_detector *detector, const double *row, padded_row *padded) {
  for (int i = 0; i < GROUSER_PADDED_COLUMNS; i++) padded->x[i] = i < detector->columns ? row[i] : 0.0;
}

static int in_box(const grouser_detector *detector, const padded_row *row) {
  int inside = 1;
  for (int i = 0; i < GROUSER_PADDED_COLUMNS; i++) {
    const double x = row->x[i], slack = detector->slack[i];
    inside &= (detector->low[i] - slack <= x) & (x <= detector->high[i] + slack);
  }
  return inside;
}

/* Vectors by name, since compilers left to themselves turn the loops round. */
static void whiten_part(const grouser_detector *detector, const double *offset, int first, double *white) {
#if defined(__GNUC__)
  typedef double part __attribute__((vector_size(GROUSER_PART * sizeof(double))));
  part sum = {0}, column;
  for (int j = 0; j < detector->columns; j++) {
    memcpy(&column, detector->whitening[j] + first, sizeof column);
    sum += column * offset[j];
  }
  memcpy(white, &sum, sizeof sum);
#else
  for (int l = 0; l < GROUSER_PART; l++) {
    white[l] = 0;
    for (int j = 0; j < detector->columns; j++) white[l] += detector->whitening[j][first + l] * offset[j];
  }
#endif
}

/* Writes offset = x - center and white = W offset, and returns |white|. */
static double distance(const grouser_detector *detector, padded_row *row) {
  double square = 0;
  for (int i = 0; i < GROUSER_PADDED_COLUMNS; i++) row->offset[i] = row->x[i] - detector->center[i];
  for (int first = 0; first < GROUSER_PADDED_COLUMNS; first += GROUSER_PART)
    whiten_part(detector, row->offset, first, row->white + first);
  for (int i = 0; i < detector->columns; i++) square += row->white[i] * row->white[i];
  return sqrt(square);
}

/* Column that adds most to |white|^2; one whose share is NaN wins. */
static int worst_column(const grouser_detector *detector, const padded_row *row) {
  int worst = 0;
  double largest = -INFINITY;
  for (int j = 0; j < detector->columns; j++) {
    double share = 0;
    for (int i = 0; i < detector->columns; i++) share += row->white[i] * detector->whitening[j][i];
    share *= row->offset[j];
    if (isnan(share)) return j;
    if (share > largest) {
      largest = share;
      worst = j;
    }
  }
  return worst;
}

static grouser_detection outside(const grouser_detector *detector, padded_row *row) {
  grouser_detection detection = {INFINITY, GROUSER_FINITE, 0};
  for (int i = 0; i < detector->columns; i++)
    if (!isfinite(row->x[i])) {
      detection.worst_column = i;
      return detection;
    }
  double largest = -INFINITY;
  for (int i = 0; i < detector->columns; i++) {
    const double excess = fmax(detector->low[i] - row->x[i], row->x[i] - detector->high[i]) / detector->reach[i];
    if (excess > largest) {
      largest = excess;
      detection.worst_column = i;
    }
  }
  const double far = distance(detector, row) / detector->threshold;
  detection.reason = GROUSER_BOX;
  /* A distance that overflowed to NaN is passed over. */
  detection.score = far > 1.0 + largest ? far : 1.0 + largest;
  return detection;
}

int grouser_in_distribution(const grouser_detector *detector, const double *row) {
  padded_row padded;
  pad_row(detector, row, &padded);
  return in_box(detector, &padded) && distance(detector, &padded) / detector->threshold <= 1.0;
}

grouser_detection grouser_detect(const grouser_detector *detector, const double *row) {
  padded_row padded;
  pad_row(detector, row, &padded);
  if (!in_box(detector, &padded)) return outside(detector, &padded);
  grouser_detection detection = {0, GROUSER_NONE, 0};
  detection.score = distance(detector, &padded) / detector->threshold;
  detection.worst_column = worst_column(detector, &padded);
  if (grouser_out_of_distribution(&detection)) detection.reason = GROUSER_DISTANCE;
  return detection;
}
