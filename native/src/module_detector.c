#include <math.h>

#include "grouser/detector.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_detector detector;
} detector_object;

static const char *const REASONS[] = {"none", "finite", "box", "distance"};

static PyObject *detector_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"columns", "low", "high", "center", "whitening", "threshold", NULL};
  PyObject *low_object, *high_object, *center_object, *whitening_object;
  double threshold, low[GROUSER_MAX_COLUMNS], high[GROUSER_MAX_COLUMNS], center[GROUSER_MAX_COLUMNS];
  double whitening[GROUSER_MAX_COLUMNS * GROUSER_MAX_COLUMNS];
  int columns;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iOOOOd", names, &columns, &low_object, &high_object,
                                   &center_object, &whitening_object, &threshold))
    return NULL;
  if (columns < 1 || columns > GROUSER_MAX_COLUMNS)
    return PyErr_Format(PyExc_ValueError, "columns must lie in [1, %d], got %d", GROUSER_MAX_COLUMNS, columns);
  if (!(threshold > 0 && isfinite(threshold))) {
    PyErr_SetString(PyExc_ValueError, "threshold must be positive and finite");
    return NULL;
  }
  if (grouser_copy_doubles(low_object, "low", columns, low) < 0 ||
      grouser_copy_doubles(high_object, "high", columns, high) < 0 ||
      grouser_copy_doubles(center_object, "center", columns, center) < 0 ||
      grouser_copy_doubles(whitening_object, "whitening", columns * columns, whitening) < 0)
    return NULL;
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  detector_object *self = (detector_object *)allocate(type, 0);
  if (self) grouser_detector_init(&self->detector, columns, low, high, center, whitening, threshold);
  return (PyObject *)self;
}

static void detector_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyObject *detect(PyObject *self, PyObject *row_object) {
  const grouser_detector *detector = &((detector_object *)self)->detector;
  double row[GROUSER_MAX_COLUMNS];
  if (grouser_copy_doubles(row_object, "row", detector->columns, row) < 0) return NULL;
  const grouser_detection detection = grouser_detect(detector, row);
  return Py_BuildValue("dsi", detection.score, REASONS[detection.reason], detection.worst_column);
}

static PyObject *detector_capsule(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New(&((detector_object *)self)->detector, GROUSER_DETECTOR_CAPSULE, NULL);
}

static PyGetSetDef detector_attributes[] = {
    {"detector", detector_capsule, NULL, "The compiled detector itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyMethodDef detector_methods[] = {
    {"detect", detect, METH_O, "detect(row): score, reason and worst column of one row, which need not be finite."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot detector_slots[] = {{Py_tp_new, detector_new},
                                       {Py_tp_dealloc, detector_dealloc},
                                       {Py_tp_methods, detector_methods},
                                       {Py_tp_getset, detector_attributes},
                                       {Py_tp_doc, "Finite, box, Mahalanobis distance: whether a row is like the training data."},
                                       {0, NULL}};

static PyType_Spec detector_spec = {"grouser.native._core.Detector", sizeof(detector_object), 0, Py_TPFLAGS_DEFAULT,
                                    detector_slots};

int grouser_add_detector_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&detector_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Detector", type);
  Py_DECREF(type);
  return status;
}
