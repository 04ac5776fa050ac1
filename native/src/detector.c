#include "grouser/detector.h"

#include <math.h>
#include <string.h>

/* Share of a column's width by which a row may pass the box: rounding to float32 is no excursion. */
static const double EDGE_TOLERANCE = 1e-6;

void grouser_detector_init(grouser_detector *detector, int columns, const double *low, const double *high,
                           const double *center, const double *whitening, double threshold) {
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
  }
  for (int j = 0; j < columns; j++)
    for (int i = 0; i < GROUSER_PADDED_ROWS; i++)
      detector->whitening[j][i] = i < columns ? whitening[i * columns + j] : 0.0;
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
  memcpy(white + first, &sum, sizeof sum);
#else
  for (int i = first; i < first + GROUSER_PART; i++) {
    white[i] = 0;
    for (int j = 0; j < detector->columns; j++) white[i] += detector->whitening[j][i] * offset[j];
  }
#endif
}

/* Writes offset = row - center and white = W offset (GROUSER_PADDED_ROWS), and returns |white|. */
static double distance(const grouser_detector *detector, const double *row, double *offset, double *white) {
  const int columns = detector->columns;
  double square = 0;
  for (int j = 0; j < columns; j++) offset[j] = row[j] - detector->center[j];
  for (int first = 0; first < GROUSER_PADDED_ROWS; first += GROUSER_PART) whiten_part(detector, offset, first, white);
  for (int i = 0; i < columns; i++) square += white[i] * white[i];
  return sqrt(square);
}

/* Column that adds most to |white|^2; one whose share is NaN wins. */
static int worst_column(const grouser_detector *detector, const double *offset, const double *white) {
  const int columns = detector->columns;
  int worst = 0;
  double largest = -INFINITY;
  for (int j = 0; j < columns; j++) {
    double share = 0;
    for (int i = 0; i < columns; i++) share += white[i] * detector->whitening[j][i];
    share *= offset[j];
    if (isnan(share)) return j;
    if (share > largest) {
      largest = share;
      worst = j;
    }
  }
  return worst;
}

static grouser_detection outside(const grouser_detector *detector, const double *row) {
  grouser_detection detection = {INFINITY, GROUSER_FINITE, 0};
  for (int i = 0; i < detector->columns; i++)
    if (!isfinite(row[i])) {
      detection.worst_column = i;
      return detection;
    }
  double largest = -INFINITY;
  for (int i = 0; i < detector->columns; i++) {
    const double excess = fmax(detector->low[i] - row[i], row[i] - detector->high[i]) / detector->reach[i];
    if (excess > largest) {
      largest = excess;
      detection.worst_column = i;
    }
  }
  double offset[GROUSER_MAX_COLUMNS], white[GROUSER_PADDED_ROWS];
  const double far = distance(detector, row, offset, white) / detector->threshold;
  detection.reason = GROUSER_BOX;
  /* A distance that overflowed to NaN is passed over. */
  detection.score = far > 1.0 + largest ? far : 1.0 + largest;
  return detection;
}

static int in_box(const grouser_detector *detector, const double *row) {
  for (int i = 0; i < detector->columns; i++) {
    const double slack = detector->slack[i];
    if (!(detector->low[i] - slack <= row[i] && row[i] <= detector->high[i] + slack)) return 0;
  }
  return 1;
}

int grouser_in_distribution(const grouser_detector *detector, const double *row) {
  double offset[GROUSER_MAX_COLUMNS], white[GROUSER_PADDED_ROWS];
  return in_box(detector, row) && distance(detector, row, offset, white) / detector->threshold <= 1.0;
}

grouser_detection grouser_detect(const grouser_detector *detector, const double *row) {
  if (!in_box(detector, row)) return outside(detector, row);
  double offset[GROUSER_MAX_COLUMNS], white[GROUSER_PADDED_ROWS];
  grouser_detection detection = {0, GROUSER_NONE, 0};
  detection.score = distance(detector, row, offset, white) / detector->threshold;
  detection.worst_column = worst_column(detector, offset, white);
  if (grouser_out_of_distribution(&detection)) detection.reason = GROUSER_DISTANCE;
  return detection;
}
