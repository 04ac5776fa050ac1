#include <math.h>
#include <string.h>

#include "grouser/mlp.h"
#include "module.h"

typedef struct {
  grouser_kernel_object base;
  grouser_mlp net;
  void *parameters; /* what the network points into */
} mlp_object;

static PyObject *mlp_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"activation",  "widths",      "parameters",   "input_mean",
                          "input_scale", "output_mean", "output_scale", NULL};
  int activation;
  PyObject *widths, *bytes, *input_mean, *input_scale, *output_mean, *output_scale;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iOOOOOO", names, &activation, &widths, &bytes, &input_mean,
                                   &input_scale, &output_mean, &output_scale))
    return NULL;
  grouser_mlp net;
  memset(&net, 0, sizeof net);
  void *parameters = grouser_read_dense(activation, widths, bytes, &net.dense);
  if (!parameters) return NULL;
  const int inputs = net.dense.widths[0], outputs = net.dense.widths[net.dense.layers];
  if (inputs > GROUSER_MAX_COLUMNS || outputs != GROUSER_OUTPUTS) {
    PyErr_Format(PyExc_ValueError, "a network takes at most %d inputs and returns %d outputs", GROUSER_MAX_COLUMNS,
                 GROUSER_OUTPUTS);
    PyMem_Free(parameters);
    return NULL;
  }
  if (grouser_copy_doubles(input_mean, "input_mean", inputs, net.input_mean) < 0 ||
      grouser_copy_doubles(input_scale, "input_scale", inputs, net.input_scale) < 0 ||
      grouser_copy_doubles(output_mean, "output_mean", outputs, net.output_mean) < 0 ||
      grouser_copy_doubles(output_scale, "output_scale", outputs, net.output_scale) < 0) {
    PyMem_Free(parameters);
    return NULL;
  }
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  mlp_object *self = (mlp_object *)allocate(type, 0);
  if (!self) {
    PyMem_Free(parameters);
    return NULL;
  }
  self->net = net;
  self->base.kernel = grouser_chosen_level()->mlp(&self->net);
  self->parameters = parameters;
  return (PyObject *)self;
}

static void mlp_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyMem_Free(((mlp_object *)self)->parameters);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyMethodDef mlp_methods[] = {GROUSER_KERNEL_METHODS, {NULL, NULL, 0, NULL}};

static PyGetSetDef mlp_attributes[] = {
    {"kernel", grouser_object_capsule, NULL, "The kernel as a capsule, for other compiled code.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyType_Slot mlp_slots[] = {{Py_tp_new, mlp_new},
                                  {Py_tp_dealloc, mlp_dealloc},
                                  {Py_tp_methods, mlp_methods},
  {Py_tp_getset, mlp_attributes},
                                  {Py_tp_doc, "A dense float32 network between float64 interface columns and forces."},
                                  {0, NULL}};

static PyType_Spec mlp_spec = {"grouser.native._core.Mlp", sizeof(mlp_object), 0, Py_TPFLAGS_DEFAULT, mlp_slots};

int grouser_add_mlp_type(PyObject *module) {
  PyObject *type = PyType_FromModuleAndSpec(module, &mlp_spec, NULL);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Mlp", type);
  Py_DECREF(type);
  return status;
}
